"""Whole processes: `mdstopo run` from start to file, `mdstopo --help`, the first run on a fresh machine."""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from statistics import median

from benchmarks.scenes import CASES
from mdstopo.bench.tables import Table, spread, verdict

ROUNDS = 7

MDSTOPO = [sys.executable, "-m", "mdstopo"]
# A tolerance that is never met, so that the iterations do not end early for it.
RUN = [*MDSTOPO, "run", str(CASES / "fig6.yaml"), "--overwrite", "--json", "--quiet", "--set", "optimizer.tolerance=0"]


def process() -> Iterator[Table]:
    """One table: warm run, its iterations, help against numba, first run."""
    with tempfile.TemporaryDirectory() as folder:
        run = [*RUN, "--out", str(Path(folder) / "fig6.h5")]
        _, document = _timed(run)  # whatever is not compiled yet is compiled here
        whole, inside, ready, bare, numba = [], [], [], [], []
        for _ in range(ROUNDS):
            seconds, document = _timed(run)
            whole.append(seconds)
            inside.append(document["seconds"])
            ready.append(document["compile_seconds"])
            bare.append(_timed([*MDSTOPO, "--help"])[0])
            numba.append(_timed([sys.executable, "-c", "import numba"])[0])
        first, cold_document = _timed(run, {"MDSTOPO_CACHE_DIR": str(Path(folder) / "kernels")})
    share = median(inside) / median(whole)
    ratio = median(bare) / median(numba)
    done = f"{document['iterations']} iterations, {document['evaluations']} evaluations"
    yield Table(
        "The whole process, cases/fig6.yaml",
        ("what", "seconds, median (least - most)", "bar", "met"),
        [
            [f"warm `mdstopo run`, start to file, {done}", spread(whole), "at most 0.9", verdict(median(whole) <= 0.9)],
            [
                "of that, the iterations",
                spread(inside),
                f"less than a tenth of 0.9 ({share:.2f} of this process)",
                verdict(median(inside) < 0.09),
            ],
            ["of that, loading kernels", spread(ready), "", ""],
            ["`mdstopo --help`", spread(bare), f"under 0.2 of `import numba` (here {ratio:.2f})", verdict(ratio < 0.2)],
            ["`python -c 'import numba'`", spread(numba), "", ""],
            [
                f"first run, no kernel on the disk, of that {cold_document['compile_seconds']:.1f} compiling",
                f"{first:.1f}",
                "under 30",
                verdict(first < 30.0),
            ],
        ],
        (f"Times of {ROUNDS} processes, taken in turn.",),
    )


def _timed(command: Sequence[str], more: Mapping[str, str] | None = None) -> tuple[float, dict]:
    # An installed package has its byte code on the disk, whatever this process may write.
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"} | dict(more or {})
    began = time.perf_counter()
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    seconds = time.perf_counter() - began
    return seconds, json.loads(done.stdout) if done.stdout.startswith("{") else {}
