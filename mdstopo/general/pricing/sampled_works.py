"""What some candidates would do at the states from which prices follow, for Python (`driver.fewer_states`)."""

import numpy as np

from mdstopo.compiler.jit import entry
from mdstopo.general.model.general_model import unpack_general
from mdstopo.general.model.priced_candidates import CODE, FIRST_STATE, unpack_candidates
from mdstopo.general.pricing.loaded_members import load_members
from mdstopo.general.pricing.switching_together import is_quick
from mdstopo.mechanics.kinematics.kinematics_interface import (
    ALONG,
    ELONGATION,
    INVERSE,
    RATE,
    WORKS,
    freedoms,
    member_works,
)
from mdstopo.mechanics.laws.law_table import law_degree

#: columns of what `sample_works` writes; from the last one on there is one for each component of a change of the pose
OF_ELONGATION, OF_RATE, OF_INVERSE, OF_CHANGES = range(4)


@entry
def sample_works(ints, floats, candidate_ints, candidate_floats, k, places, out):
    """Elongations, rates, and how fast elongations change along each component of a change of the pose.

    In:
      ints, floats, candidate_ints, candidate_floats: as of `candidate_prices.price_places`.
      k: number of a run.
      places (2, M): numbers of the points of each candidate.
    Out:
      out (T, 3 + D, M): of the run's states: elongations (m), rates (m/s), inverse lengths (1/m), changes.

    Returns of which degree forces are in elongations in a mode; 0 where they depend on time, or no degree is known.
    """
    model = unpack_general(ints, floats.copy())
    candidates = unpack_candidates(candidate_ints, candidate_floats)
    count = np.int64(places.shape[1])
    load_members(model, candidates, k, places, count, np.int64(0))
    run = candidates.run[k]
    works = np.zeros((WORKS, model.member.shape[1]))
    along = np.eye(freedoms(model))
    for s in range(out.shape[0]):
        for c in range(freedoms(model)):
            member_works(model, np.int64(0), count, candidates.pose[run[FIRST_STATE] + s, 0], along[c], works)
            out[s, OF_CHANGES + c] = works[ALONG, :count]
        out[s, OF_ELONGATION] = works[ELONGATION, :count]
        out[s, OF_RATE] = works[RATE, :count]
        out[s, OF_INVERSE] = works[INVERSE, :count]
    return law_degree(run[CODE]) if is_quick(run[CODE], candidates.law[k], model.curves) else 0
