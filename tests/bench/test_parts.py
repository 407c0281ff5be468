"""What `benchmarks.parts` leaves out is there: a part with another name would be measured beside itself."""

import subprocess
import sys

from tests.layers.test_imports import ROOT

LEFT_OUT = """
import subprocess
from benchmarks import parts
for *_, leave_out in parts.PARTS.values():
    leave_out()
subprocess.Popen = parts._NoProcess
import mdstopo.session.compiling_apart
try:
    subprocess.Popen(["true"])
except OSError:
    print("no process")
"""


def test_every_part_can_be_left_out_and_no_process_compiles_beside() -> None:
    done = subprocess.run([sys.executable, "-c", LEFT_OUT], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "no process\n"), done.stderr
