"""The members that carry anything: all others are left out of the motion.

A member whose strengths are zero (alpha^mu = 0) adds nothing to any sum. Where so many are like that that it pays, the
others are written behind the strengths, block by block and in their order, and the motion is computed with these; they
are no grids any more. Only the design decides, so that results depend on nothing else. The gradient needs all members:
at mu = 1 one that carries nothing has a slope.
"""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.compiler.threads import shared, taken
from mdstopo.mechanics.passes import springs_of, threads_for
from mdstopo.scene.springs_model import (
    BLOCK,
    CHUNK_BLOCK,
    CHUNK_START,
    CHUNK_STOP,
    COUNT,
    DAMPING,
    KIND,
    MEMBER,
    SCALED_DAMPING,
    SCALED_PRELOAD,
    SCALED_STIFFNESS,
    START,
    STIFFNESS,
    VECTOR,
    WIDTH,
    Model,
    Springs,
)

#: costs of a member of a grid and of another: all that are left have to cost at most three quarters of what all do
IN_GRID, PLAIN = 2, 3
#: rows of an array of strengths with room behind them for the members that carry, in rows as of `Model.member`
ROOMY = 12


@part
def active_members(model, strength, fill):
    """The model without the members whose alpha is zero, their strengths, and how many members are left.

    In: strength (3, M_padded), or (ROOMY, M_padded) with room behind, to which the members that carry are written;
    fill: whether to do that, else they are there already, from the same strengths. The model itself comes back where
    there is no room, or too few carry nothing.
    """
    springs, own, left = _gather_active(springs_of(model), strength, fill)
    return (
        Model(
            model.inv_mass, model.q0, model.v0, model.home, model.pair, model.reach, model.shortest, springs.block,
            model.power, model.near, springs.member, model.times, model.force, model.load_body, model.load_follows,
            model.load_arm, model.load_force, springs.chunk, model.threads,
        ),
        own,
        left,
    )  # fmt: skip


@kernel
def _gather_active(springs, strength, fill):
    """What `active_members` does, for a model's `Springs`: few arrays to choose between."""
    block = springs.block
    parts = springs.chunk.shape[0]
    count = np.zeros(parts, np.int64)
    job = (np.zeros(1, np.int64), springs.chunk, block, strength, count)
    shared(_count_chunks, threads_for(springs, np.int64(1)), job)
    left = 0
    for i in range(parts):
        left += count[i]
    members = 0
    cost = 0
    for k in range(block.shape[0]):
        members += block[k, COUNT]
        cost += block[k, COUNT] * (IN_GRID if block[k, WIDTH] > 0 else PLAIN)
    if strength.shape[0] < ROOMY or 4 * PLAIN * left > 3 * cost:
        return springs, strength[:3], members
    # where each chunk begins among those that are left
    begin = np.empty(parts, np.int64)
    fewer = np.zeros((block.shape[0], BLOCK), np.int64)
    for k in range(block.shape[0]):
        for j in range(5):
            fewer[k, j] = block[k, j]
    for i in range(parts):
        k = springs.chunk[i, CHUNK_BLOCK]
        begin[i] = block[k, START] + fewer[k, 5]
        fewer[k, 5] += count[i]
    for k in range(block.shape[0]):
        fewer[k, 2] = block[k, START] + (fewer[k, 5] + VECTOR - 1) // VECTOR * VECTOR
    chunk = np.empty((parts, 3), np.int64)
    for i in range(parts):
        k = springs.chunk[i, CHUNK_BLOCK]
        chunk[i, CHUNK_BLOCK] = k
        chunk[i, CHUNK_START] = springs.chunk[i, CHUNK_START]
        chunk[i, CHUNK_STOP] = min(springs.chunk[i, CHUNK_STOP], fewer[k, 2])
    room = strength[3:ROOMY]
    if fill:
        gather = (np.zeros(1, np.int64), springs.chunk, block, springs.member, strength, begin, count, room)
        shared(_gather_chunks, threads_for(springs, np.int64(1)), gather)
        for k in range(block.shape[0]):
            for row in range(MEMBER):
                for i in range(fewer[k, 1] + fewer[k, 5], fewer[k, 2]):
                    room[row, i] = 0.0
    return Springs(fewer, room, chunk, springs.threads, springs.near), room[STIFFNESS:MEMBER], left


@kernel
def _count_chunks(counter, chunk, block, strength, count):
    """Count the active members, chunk after chunk, until none is left: the work of one thread."""
    i = taken(counter)
    while i < chunk.shape[0]:
        count[i] = _count(chunk[i, CHUNK_BLOCK], chunk[i, CHUNK_START], chunk[i, CHUNK_STOP], block, strength)
        i = taken(counter)


@kernel
def _count(k, start, stop, block, strength):
    """How many of the members in places start to stop of block k are active."""
    s = strength[SCALED_STIFFNESS, start:stop]
    found = 0
    if block[k, KIND] == 0:
        for i in range(s.shape[0]):
            found += s[i] != 0.0
        return found
    c = strength[SCALED_DAMPING, start:stop]
    p = strength[SCALED_PRELOAD, start:stop]
    for i in range(s.shape[0]):
        found += (s[i] != 0.0) | (c[i] != 0.0) | (p[i] != 0.0)
    return found


@kernel
def _gather_chunks(counter, chunk, block, member, strength, begin, count, room):
    """Copy the active members, chunk after chunk, until none is left: the work of one thread.

    In:
      counter (1,): chunks that some thread has taken so far; counted on.
      chunk, block, member: as of `Model`.
      strength (3 or more, M_padded): stiffness, damping and preload times alpha^mu (N/m, N s/m, N).
      begin (n_chunk,): the first place in room for the members of each chunk.
      count (n_chunk,): how many members of each chunk carry something.
    Out:
      room (MEMBER, M_padded): rows as of `Model.member`, with strengths for the last three.
    """
    i = taken(counter)
    while i < chunk.shape[0]:
        _gather(
            chunk[i, CHUNK_BLOCK],
            chunk[i, CHUNK_START],
            chunk[i, CHUNK_STOP],
            block,
            member,
            strength,
            begin[i],
            count[i],
            room,
        )
        i = taken(counter)


@kernel
def _gather(k, start, stop, block, member, strength, begin, count, room):
    """Copy the active members in places start to stop of block k.

    In:
      k: number of the block.
      start, stop: places in the padded arrays.
      block (n_block, BLOCK), member (MEMBER, M_padded): as of `Model`.
      strength (3 or more, M_padded): stiffness, damping and preload times alpha^mu (N/m, N s/m, N).
      begin: the first place in room.
      count: how many there are.
    Out:
      room (MEMBER, M_padded): rows as of `Model.member`, with strengths for the last three; damping and preload are
        written where the block has them.
    """
    viscous = block[k, KIND] == 1
    place = np.empty(stop - start, np.int64)
    found = 0
    for i in range(start, stop):
        place[found] = i  # without a branch: zeros come at random
        something = strength[SCALED_STIFFNESS, i] != 0.0
        if viscous:
            something |= (strength[SCALED_DAMPING, i] != 0.0) | (strength[SCALED_PRELOAD, i] != 0.0)
        found += something
    for row in range(MEMBER if viscous else DAMPING):
        source = member[row] if row < STIFFNESS else strength[row - STIFFNESS]
        target = room[row]
        for i in range(count):
            target[begin + i] = source[place[i]]
