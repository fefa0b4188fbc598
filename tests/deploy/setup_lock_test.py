"""deploy/setup waits while another program holds the locks of apt, says for whom, and gives up.

The real apt-get runs, with folders, locks and a source of packages of its own, and a dpkg that does
nothing: the machine's own packages are neither locked nor changed. Exit code 77: it was skipped.
"""
import fcntl
import hashlib
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

SETUP = Path(__file__).resolve().parents[2] / "deploy/setup"
MISSING = "mold"  # of what deploy/setup wants; nothing depends on it


class Setup(unittest.TestCase):
    def setUp(self):
        place = tempfile.TemporaryDirectory()
        self.addCleanup(place.cleanup)
        folder = self.folder = Path(place.name)
        for name in ("dpkg", "state/lists/partial", "cache/archives/partial", "log", "source/package/DEBIAN"):
            (folder / name).mkdir(parents=True)
        installed = Path("/var/lib/dpkg/status").read_text().split("\n\n")
        (folder / "dpkg/status").write_text(
            "\n\n".join(entry for entry in installed if not entry.startswith(f"Package: {MISSING}\n")))
        self.make_source(folder / "source")
        dpkg = folder / "dpkg-that-does-nothing"
        dpkg.write_text(f'#!/bin/sh\necho "$@" >>{folder}/dpkg.log\n')
        dpkg.chmod(0o755)
        (folder / "sources.list").write_text(f"deb [trusted=yes] file:{folder}/source ./\n")
        (folder / "apt.conf").write_text(f"""
            Dir::State "{folder}/state"; Dir::State::status "{folder}/dpkg/status"; Dir::Cache "{folder}/cache";
            Dir::Log "{folder}/log"; Dir::Bin::dpkg "{dpkg}"; Dir::Etc::Main "/dev/null"; Dir::Etc::Parts "/dev/null";
            Dir::Etc::SourceList "{folder}/sources.list"; Dir::Etc::SourceParts "/dev/null";
            APT::Sandbox::User "root";
        """)

    def make_source(self, source: Path) -> None:
        control = f"Package: {MISSING}\nVersion: 99\nArchitecture: all\nMaintainer: nobody\nDescription: a test\n"
        (source / "package/DEBIAN/control").write_text(control)
        package = source / f"{MISSING}.deb"
        subprocess.run(["dpkg-deb", "--build", source / "package", package], check=True, stdout=subprocess.DEVNULL)
        content = package.read_bytes()
        (source / "Packages").write_text(f"{control}Filename: ./{package.name}\nSize: {len(content)}\n"
                                         f"SHA256: {hashlib.sha256(content).hexdigest()}\n")

    def hold(self, lock: str):
        file = open(self.folder / lock, "w")
        fcntl.lockf(file, fcntl.LOCK_EX)
        return file

    def start(self, *options: str) -> subprocess.Popen:
        own = {"APT_CONFIG": f"{self.folder}/apt.conf", "DPKG_ADMINDIR": f"{self.folder}/dpkg"}
        return subprocess.Popen([SETUP, "--yes", *options], env=os.environ | own, text=True,
                                stdout=subprocess.PIPE, stderr=subprocess.STDOUT)

    def test_waits_for_the_lists_and_for_the_installation(self):
        lists, installation = self.hold("state/lists/lock"), self.hold("dpkg/lock-frontend")
        waits = []
        with self.start() as setup:
            for line in setup.stdout:
                if line.startswith("Waiting for "):
                    waits.append(line)
                    (lists if len(waits) == 1 else installation).close()
        holder = Path("/proc/self/comm").read_text().strip()
        self.assertEqual(waits, [f"Waiting for {holder} (process {os.getpid()}), which installs packages: "
                                 "0 of at most 30 min\n"] * 2)
        self.assertEqual(setup.returncode, 0)
        self.assertIn("--unpack", (self.folder / "dpkg.log").read_text())

    def test_gives_up(self):
        self.hold("state/lists/lock").close()
        with self.hold("dpkg/lock-frontend"), self.start("--wait", "0") as setup:
            last = setup.communicate()[0].splitlines()[-1]
        self.assertRegex(last, rf"^deploy/setup: waited 0 min for .* \(process {os.getpid()}\), which installs "
                               "packages: let it end, then run this again$")
        self.assertEqual(setup.returncode, 5)
        self.assertFalse("--unpack" in (self.folder / "dpkg.log").read_text())


def reason_to_skip() -> str:
    if os.geteuid() != 0:
        return "only root may install packages"
    if subprocess.run([SETUP], stdin=subprocess.DEVNULL, capture_output=True).returncode != 0:
        return "more is missing here than this test takes away: run deploy/setup"
    return ""


if __name__ == "__main__":
    if reason := reason_to_skip():
        print(f"SKIPPED: {reason}, so nobody saw how deploy/setup waits for others")
        sys.exit(77)
    unittest.main()
