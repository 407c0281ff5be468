"""The methods beside the adjoint one, by name: they differentiate the rows that a general driver has found."""

from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

import numpy as np

from mdstopo.case.methods.integrators import having
from mdstopo.case.methods.over_time import ReductionKind
from mdstopo.case.methods.sensitivities import SENSITIVITIES
from mdstopo.general.driver.row_gradients import BLOCK, Block, sign_of, wanted_rows
from mdstopo.general.responses.extremes import RATE, SIGN, parts, row_of
from mdstopo.general.responses.integral_reductions import value_of_integral
from mdstopo.integrators.scene_driver import ResponseResult
from mdstopo.integrators.steps import OK, status_of
from mdstopo.scene.springs_model import FloatArray
from mdstopo.status import Status

if TYPE_CHECKING:
    from mdstopo.general.driver.general_driver import GeneralDriver

#: iterations of the iterative method before it counts as not contracting, and what is said then
ITERATIONS = 200
FALLBACK = "the iterations of the iterative method do not contract at t = {:.6g} s; direct was taken instead"
#: times at which constant_load forms a mean or an integral over time
NODES = 201
#: singular values below this times the largest are dropped by constant_load
DROPPED = 1e-10


def differentiate(
    driver: "GeneralDriver", method: str, alpha: FloatArray, result: ResponseResult, across: FloatArray | None = None
) -> tuple[FloatArray, str]:
    """Gradients (n_resp, R, N) by alpha (N,) of the rows that `evaluate` found, by a method whose gradients do not come
    with the values; and what the user should know although it worked.

    across (n_resp, R, N): is filled, where the method tells that (`evaluation.Peak.across`). Raises ValueError for a
    method that is not defined on the integrator's steps.
    """
    needed = SENSITIVITIES[method].steps
    if needed and not getattr(driver.method.kind, needed):
        raise ValueError(f"the {method} method is defined on the steps of {', '.join(having(needed))}")
    found: tuple[FloatArray, str] = resolve_name(SENSITIVITIES[method].made_by)(driver, alpha, result, across)
    return found


def by_direct(
    driver: "GeneralDriver", alpha: FloatArray, result: ResponseResult, across: FloatArray | None
) -> tuple[FloatArray, str]:
    """Gradients carried forward with the motion, as of `differentiate`."""
    return _carried(driver, alpha, result, across, 0)


def by_iterative(
    driver: "GeneralDriver", alpha: FloatArray, result: ResponseResult, across: FloatArray | None
) -> tuple[FloatArray, str]:
    """The same by fixed-point iterations over implicit steps; by `by_direct` where these do not contract."""
    return _carried(driver, alpha, result, across, ITERATIONS)


def by_constant_load(
    driver: "GeneralDriver", alpha: FloatArray, result: ResponseResult, across: FloatArray | None
) -> tuple[FloatArray, str]:
    """Gradients with inertia and loads frozen; `across` is left as it is."""
    gradients, rows = np.zeros_like(result.gradients), result.rows.copy()
    for j, reduction in enumerate(driver.scene.reductions):
        for r in range(int(result.row_counts[j])):
            gradients[j, r] = _held(driver, j, rows[j, r], reduction, driver.count)
    return gradients, ""


def _with_tangents(driver: "GeneralDriver", alpha: FloatArray) -> int:
    """Have the motion that was evaluated last with its tangents; returns how many steps it has.

    Where these were left out it is simulated again, and the work is added to what was counted.
    """
    if driver.keeps_tangents:
        return driver.count
    before = driver.work.copy()
    _, count, _ = driver.run(alpha, True, driver.quadrature_breakpoints)
    driver.work += before
    return count


def _carried(
    driver: "GeneralDriver", alpha: FloatArray, result: ResponseResult, across: FloatArray | None, iterations: int
) -> tuple[FloatArray, str]:
    """As `by_direct`. iterations: above 0, implicit stages are solved by so many fixed-point iterations at most."""
    gradients = np.zeros_like(result.gradients)
    count = _with_tangents(driver, alpha)
    wanted = wanted_rows(driver, across is not None)[::-1]
    most = max(1, BLOCK // max(1, len(driver.padded)))
    for first in range(0, len(wanted), most):
        part = wanted[first : first + most]
        block = driver.row_gradients.block(len(part))
        for m, each in enumerate(part):
            block.which[m] = each.response, each.is_across
            block.rows[m] = each.at
        stopped = _push(driver, count, block, 0, iterations)
        if stopped >= 0:
            return _by_direct_instead(driver, alpha, result, across, stopped)
        for (j, r, is_across, share, row), own in zip(part, block.out, strict=True):
            _add_since_settled(driver, j, row, bool(is_across), 0, count, own)
            if is_across and across is not None:
                across[j, r] += share * own
            else:
                gradients[j, r] += sign_of(driver, j, r) * share * own
    for j, reduction in enumerate(driver.scene.reductions):
        if reduction.is_integral and result.row_counts[j]:
            integral, row, block = reduction.power, result.rows[j, 0], driver.row_gradients.block(1)
            block.which[0] = j, 0
            stopped = _push(driver, count, block, integral, iterations)
            if stopped >= 0:
                return _by_direct_instead(driver, alpha, result, across, stopped)
            _add_since_settled(driver, j, row, False, integral, count, block.out[0])
            gradients[j, 0] += row.item(RATE) * block.out[0]
    return gradients, ""


def _push(driver: "GeneralDriver", count: int, block: Block, integral: int, iterations: int) -> int:
    """Derivatives of the rows of a block, the earliest first, or of an integral, into its `out`.

    driver, count: with a finished run, and how many steps it has. integral, iterations: as of `direct.push`.

    Returns the step where iterations did not settle, or -1.
    """
    arguments = _push_arguments(driver, count, block, integral, iterations, driver.start_slopes())
    stopped: int = driver.ready(f"push {len(block.rows)}", driver.entry.push, *arguments)
    return stopped


def _push_arguments(
    driver: "GeneralDriver", count: int, block: Block, integral: int, iterations: int, slopes: FloatArray
) -> tuple[Any, ...]:
    """All arguments of `direct.push`. driver, count, block, integral, iterations: as of `_push`; slopes (M, n): of the
    start."""
    return (
        *driver.steps_arguments(count), block.which, block.rows, integral, iterations, driver.room, driver.room_ints,
        driver.member_state, block.padded, block.out, slopes, driver.work,
    )  # fmt: skip


def compile_method(driver: "GeneralDriver", method: str) -> None:
    """Compile what carries derivatives forward with the motion, for a method that does so, without any motion."""
    if SENSITIVITIES[method].of_histories:
        arguments = _push_arguments(driver, 0, driver.row_gradients.block(1), 0, 0, np.zeros((0, 0)))
        driver.entry.push.compile(*arguments)


def _by_direct_instead(
    driver: "GeneralDriver", alpha: FloatArray, result: ResponseResult, across: FloatArray | None, stopped: int
) -> tuple[FloatArray, str]:
    """By `by_direct`, with the sentence that iterations of the iterative method do not contract in step `stopped`."""
    message = FALLBACK.format(float(driver.states()[0][stopped]))
    if across is not None:
        across[:] = 0.0
    return by_direct(driver, alpha, result, across)[0], message


def _add_since_settled(
    driver: "GeneralDriver", j: int, row: FloatArray, is_across: bool, integral: int, count: int, out: FloatArray
) -> None:
    """What a displacement that counts from where the scene has settled has of that place's derivatives, out (N + P,).

    driver: of the motion that was differentiated. j, row: the response, and its row of `extremes`.
    is_across: whether the component across a norm's vector is meant.
    integral: 0 where the row is meant, 1 for the integral of the response, 2 for that of its square.
    count: how many steps the motion has.
    """
    if driver.start is None or j not in driver.start.since:
        return
    since = driver.start.since
    pulled = since.integral_cotangent(j, integral, count) if integral else since.row_cotangent(j, row, is_across, count)
    driver.start.vjp(pulled, out)


def _held(driver: "GeneralDriver", j: int, row: FloatArray, reduction: ReductionKind, count: int) -> FloatArray:
    """A row's gradient (N,) by constant dynamic loading; an integral's at `NODES` times, by the trapezoidal rule."""
    if not reduction.is_integral:
        sign = row[SIGN] if reduction.is_magnitude else 1.0
        gradient = np.zeros(len(driver._alpha))
        for share, part in parts(row):
            gradient += sign * share * _held_at(driver, j, part, count)
        return gradient
    t = driver.states()[0][: count + 1].copy()
    times = np.linspace(t[0], t[-1], NODES)
    weights = np.full(NODES, (t[-1] - t[0]) / (NODES - 1))
    weights[[0, -1]] *= 0.5
    total = np.zeros(len(driver._alpha))
    integral = 0.0
    for time, weight, place in zip(times, weights, driver.places_at(times, count), strict=True):
        value, rate, who = driver.evaluate_one(j, count, place).tolist()
        at = row_of(time, value, place[0], place[1], rate, 1.0, who)
        total += weight * (2.0 * value if reduction.is_squared else 1.0) * _held_at(driver, j, at, count)
        integral += weight * (value**2 if reduction.is_squared else value)
    total *= value_of_integral(reduction, integral, float(t[-1] - t[0]))[1]
    for factor, at in driver.jumps.get(j, []):
        total += factor * _held_at(driver, j, at, count)
    return total


def _held_at(driver: "GeneralDriver", j: int, row: FloatArray, count: int) -> FloatArray:
    """The gradient (N,) at one time by constant dynamic loading."""
    from mdstopo.general.sensitivity import constant_load

    hold: Any = constant_load.hold

    model = driver.scene.model
    n, size = len(model.mass), len(model.mass) + int(model.size[0])
    own, none, z, matrix, right, out = driver.arrays_once(
        "hold", lambda: [np.zeros(k) for k in (len(row), 0, n, (size, size), size, len(driver.alpha))]
    )
    own[:] = row

    def call(name: str, given: FloatArray) -> None:
        driver.ready(
            name, hold, *driver.steps_arguments(count), j, own, driver.room, driver.room_ints, driver.member_state,
            given, matrix, right, driver.padded, out, driver.work,
        )  # fmt: skip

    call("hold for the system", none)
    # least squares of least norm: free bodies make it singular
    moving = np.concatenate([model.free != 0, np.ones(size - n, dtype=np.bool_)])
    found = np.zeros(size)
    found[moving] = np.linalg.lstsq(matrix[moving][:, moving].T, right[moving], rcond=DROPPED)[0]
    z[:] = found[:n]
    call("hold for the gradient", z)
    out = out.copy()
    _add_since_settled(driver, j, row, False, 0, count, out)
    return out


def histories(driver: "GeneralDriver", alpha: FloatArray, j: int) -> tuple[Status, FloatArray, FloatArray]:
    """Times (T,) of the steps and dg_j/dalpha (T, N) at them by `direct`; of member forces, the largest member's."""
    code, count, _ = driver.run(alpha, True)
    if code != OK:
        return status_of(code), np.zeros(0), np.zeros((0, len(alpha)))
    places = np.stack([np.maximum(np.arange(count + 1.0) - 1.0, 0.0), np.ones(count + 1)], axis=1)
    places[0, 1] = 0.0
    who = driver.sample_response(j, places, True, count)[2][:, 2].copy()
    lines = np.zeros((1, count + 1, len(alpha)))
    driver.entry.follow(
        *driver.steps_arguments(count), np.array([j]), np.arange(count + 1), who.reshape(1, -1), np.zeros((0, 2, 0)),
        np.zeros(0), True, driver.room, driver.room_ints, driver.member_state, driver.padded, lines,
        driver.start_slopes(), driver.work,
    )  # fmt: skip
    if driver.start is not None and j in driver.start.since:
        for line, q in zip(lines[0], driver.states()[1], strict=False):
            driver.start.vjp(driver.start.since.cotangent(j, q), line)
    return Status.OK, driver.states()[0][: count + 1].copy(), lines[0]
