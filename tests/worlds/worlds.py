"""Machines of ours in MuJoCo, with physics concealed in them, and how a kincal finds it.

    python tests/worlds/worlds.py make  FOLDER --release "mujoco 4.0.0" --count 16
    python tests/worlds/worlds.py judge FOLDER --kincal target/release/kincal

README.md beside this file says what is in FOLDER and what the table means.
"""
import argparse
import pathlib

root = pathlib.Path(__file__).resolve().parents[2]
parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("--machines", default=root / "machines", help="folder of machine files")
commands = parser.add_subparsers(dest="command", required=True)
one = commands.add_parser("make", help="make cases")
one.add_argument("folder")
one.add_argument("--release", required=True, help="a string whose hash is the seed, such as the name of an upstream release")
one.add_argument("--by", choices=["mujoco", "exudyn"], default="mujoco", help="the simulator")
one.add_argument("--count", type=int, default=16)
one.add_argument("--only", type=lambda s: {int(x) for x in s.split(",")}, default=None, help="numbers of cases, such as 3,7; the others stay as they are")
two = commands.add_parser("judge", help="run kincal on every case")
two.add_argument("folder")
two.add_argument("--kincal", required=True, help="the program to be judged")
two.add_argument("--jobs", type=int, default=1, help="cases at a time")
two.add_argument("--only", type=lambda s: set(s.split(",")), default=None, help="cases, such as case_003,case_007")
two.add_argument("--found", default=None, help="where what it says goes; FOLDER/found unless given")
two.add_argument("--again", action="store_true", help="use what an earlier call left there")
two.add_argument("--rivals", action="store_true", help="short scripts with textbook columns, judged alike")
two.add_argument("--json", default=None, help="where the result goes too")
commands.add_parser("check", help="each kind of physics against what mechanics says of it")

given = parser.parse_args()
if given.command == "make":
    if given.by == "mujoco":
        from make import make
    else:
        from emergent import make
    make(given.folder, given.release, given.count, given.only, given.machines)
elif given.command == "check":
    from check import check
    raise SystemExit(bool(check(given.machines)))
else:
    from judge import judge
    judge(given.folder, given.kincal, given.machines, given.jobs, given.only, given.again, given.rivals, given.found, given.json)
