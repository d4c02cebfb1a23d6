#!/usr/bin/env python3
# Copyright 2026 The Tissueform Authors.
# SPDX-License-Identifier: AGPL-3.0-or-later
"""What lies in deploy/ for operators is judged by the programs that it is for.

    tests/scripts/check_deployment.py FOLDER_OF_PROGRAMS

systemd finds the units right and little exposed, and each program starts as its unit starts it; logrotate rotates what a program goes on writing; server, gateway and
bridge read the example configurations, those lines too that are commented out, and print them back. Exit code 0 when all is so,
77 when systemd or logrotate is not installed.
"""

import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
MOST_EXPOSED = 20  # tenths, of 100
SKIPPED = 77


def run(*words):
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, timeout=60)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(str(word) for word in words)}: exit code {done.returncode}\n{done.stdout[-3000:]}{done.stderr[-2000:]}")
    return done.stdout + done.stderr


def check(condition, what):
    if not condition:
        raise RuntimeError(what)
    print(f"ok: {what}", flush=True)


def check_units(programs, scratch):
    for unit in sorted((ROOT / "deploy/systemd").glob("*.service")):
        said = run("systemd-analyze", "security", "--offline=yes", f"--threshold={MOST_EXPOSED}", unit)
        exposure = float(re.search(r"exposure level for \S+ ([0-9.]+)", said).group(1))
        check(exposure * 10 <= MOST_EXPOSED, f"{unit.name}: exposure {exposure}")
        text = unit.read_text()
        check(f"/usr/bin/{unit.stem} " in text, f"{unit.name} starts {unit.stem}")
        # Where the programs of this build lie; users and manual pages come with the packages.
        copy = scratch / unit.name
        copy.write_text(text.replace("/usr/bin/", f"{programs}/"))
        complaints = run("systemd-analyze", "verify", "--man=no", copy)
        check(unit.name not in complaints, f"{unit.name} is right for systemd {complaints.strip()}")


# What a unit's command says besides, here: ports that are free, folders that are ours.
ELSEWHERE = {
    "tissueform-server": ["--data-dir", "@/server", "--port", "0"],
    "tissueform-gateway": ["--web", "@/web", "--listen", "127.0.0.1:0"],
    "tissueform-pacs": ["--state-dir", "@/pacs", "--listen", "127.0.0.1:0", "--review-listen", "127.0.0.1:0"],
}


def check_starts(programs, scratch):
    folder = scratch / "etc"
    shutil.copytree(ROOT / "deploy/config", folder)
    shutil.copy(ROOT / "deploy/pacs/recipe.json", folder / "series-recipe.json")
    (folder / "pacs.ini").write_text((folder / "pacs.ini").read_text().replace("/etc/tissueform", str(folder)))
    (scratch / "web").mkdir()
    (scratch / "web/index.html").write_text("<!doctype html>")
    for name, elsewhere in ELSEWHERE.items():
        unit = (ROOT / f"deploy/systemd/{name}.service").read_text()
        command = re.search(r"^ExecStart=(.*)$", unit, flags=re.MULTILINE).group(1)
        command = command.replace("/usr/bin/", f"{programs}/").replace("/etc/tissueform", str(folder))
        words = [*command.split(), *(word.replace("@", str(scratch)) for word in elsewhere)]
        with open(scratch / "log", "w+", encoding="utf-8") as log:
            program = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=log, text=True)
            said = program.stdout.readline()
            program.terminate()
            program.communicate(timeout=60)
            log.seek(0)
            check(re.match("(listening|receiving) on ", said) and program.returncode == 0, f"{name} starts by its unit's command {said}{log.read() if not said else ''}".strip())


def check_rotation(logrotate, scratch):
    log = scratch / "server.log"
    example = (ROOT / "deploy/logrotate/tissueform").read_text()
    configuration = scratch / "logrotate.conf"
    configuration.write_text(re.sub(r"\n *su .*", "", example.replace("/var/log/tissueform", str(scratch))))
    configuration.chmod(0o644)
    with open(log, "a", buffering=1) as program:
        program.write("before\n")
        run(logrotate, "--force", "--state", scratch / "state", configuration)
        program.write("after\n")
    rotated = [path for path in scratch.glob("server.log-*")]
    check(len(rotated) == 1 and rotated[0].read_text() == "before\n" and log.read_text() == "after\n", "logrotate moves what was written, and the program goes on")


def check_configuration(programs, scratch):
    for name in ("server", "gateway", "pacs"):
        example = (ROOT / f"deploy/config/{name}.ini").read_text()
        full = scratch / f"{name}.ini"
        full.write_text(re.sub(r"^#(?=[a-z-]+ = )", "", example, flags=re.MULTILINE))
        program = programs / f"tissueform-{name}"
        for file in (ROOT / f"deploy/config/{name}.ini", full):
            printed = run(program, "--config", file, "--print-config")
            for option, value in re.findall(r"^([a-z-]+) = (.*)$", file.read_text(), flags=re.MULTILINE):
                check(f"\n{option} = {value}\n" in f"\n{printed}", f"{name}: {option} = {value}")
            again = scratch / "again.ini"
            again.write_text(printed)
            check(run(program, "--config", again, "--print-config") == printed, f"{name}: what is printed reads back")


def main(programs):
    logrotate = shutil.which("logrotate", path="/usr/sbin:/usr/bin:/sbin")  # sbin is not in every user's path
    if not shutil.which("systemd-analyze") or not logrotate:
        print("systemd or logrotate is not installed", file=sys.stderr)
        return SKIPPED
    with tempfile.TemporaryDirectory() as folder:
        scratch = pathlib.Path(folder)
        check_units(programs, scratch)
        check_starts(programs, scratch)
        check_configuration(programs, scratch)
        check_rotation(logrotate, scratch)
    return 0


if __name__ == "__main__":
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        sys.exit(2)
    try:
        sys.exit(main(pathlib.Path(sys.argv[1]).resolve()))
    except RuntimeError as error:
        print(f"check_deployment.py: {error}", file=sys.stderr)
        sys.exit(1)
