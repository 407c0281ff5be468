"""Distances of the shifts between iterations, where a step changes few of very many."""

import numpy as np

from mdstopo.optimizer.problem import Floats, Ints


class Shifts:
    """Distances of the shifts (N,), in ranges; seen from outside they never change.

    Most variables rest on a bound, and their shifts stay; to copy all for the others would take longer than to find
    the others. So `following` changes the array itself and notes what was there before; who still asks this object for
    its array gets it put together again (H. G. Baker, Shallow binding makes functional arrays fast, ACM SIGPLAN
    Notices 26(8), 1991). within: smallest and largest shift that are known to be kept.
    """

    __slots__ = ("_array", "_before", "_count", "_following", "_places", "within")

    def __init__(self, array: Floats, within: tuple[float, float] | None = None) -> None:
        self._array: Floats | None = array
        self._following: Shifts | None = None
        self.within = within

    def array(self) -> Floats:
        """The distances (N,): to be read, and only until `following` is called."""
        if self._array is None:
            newer, found = [self], self._following
            while found is not None and found._array is None:
                newer.append(found)
                found = found._following
            assert found is not None
            assert found._array is not None
            array = found._array.copy()
            for each in reversed(newer):
                n = int(each._count[0])
                array[each._places[:n]] = each._before[:n]
            self._array, self._following = array, None
        return self._array

    def following(self, most: int) -> tuple["Shifts", Floats, Ints, Floats, Ints]:
        """The next shifts, with the array (N,) that is now theirs: to be changed in at most so many places.

        Before a number is changed, its place and what it was go into the arrays that follow (most,), and their number
        (1,) grows: so these shifts stay what they are, even if the changes are broken off.
        """
        array = self.array()
        following = Shifts(array, self.within)
        self._places, self._before = np.empty(most, dtype=np.int64), np.empty(most)
        self._count = np.zeros(1, dtype=np.int64)
        self._array, self._following = None, following
        return following, array, self._places, self._before, self._count
