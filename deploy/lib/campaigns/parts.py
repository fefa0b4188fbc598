"""The parts of the campaign: what each builds, runs and asks for."""

import subprocess
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Callable

import mutants
from work import CORES, ROOT, Failed, Work

BIN = "build/release/bin"


@dataclass(frozen=True)
class Part:
    name: str
    run: Callable[[Work], None]
    hours: float  # about how long it takes on two cores, its build included
    about: str
    setup: tuple = ()  # further options of deploy/setup
    options: tuple = ()  # the options that it knows
    length: str = ""  # the one of them that says how long, if it can be shortened
    amount: float = 0  # of that option, unless somebody says otherwise
    table: str = "table.md"  # in its folder
    keeps: bool = False  # what it has learnt is where the next run begins

    def amount_for(self, hours: float) -> str:
        """The value of `length` with which it takes so long."""
        value = self.amount * hours / self.hours
        return f"{max(value, 0.01):.2f}" if self.length == "hours" else str(max(1, round(value)))


def tests(work):
    # Together with them everything that only campaigns and benchmarks use is built: it has to compile.
    work.build("release", "all", "on_demand")
    work.run_tests("deploy/test", "--campaign", *work.yes())


def sanitized(work):
    work.build("clang-fuzz", "sanitized_tests")
    work.run_suite("clang-fuzz", "--sanitized")


def tsan(work):
    work.build("tsan", "all", "on_demand")
    work.run_suite("tsan", env={"TSAN_OPTIONS": f"halt_on_error=1 suppressions={ROOT}/deploy/lib/tsan.supp"})


def configure_clang(work):
    if not (ROOT / "build/clang/build.ninja").exists():
        work.call("cmake", "-S", ".", "-B", "build/clang", "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release",
                  env={"CXX": "clang++"})


def clang(work):
    configure_clang(work)
    work.call("ninja", "-C", "build/clang", "all", "on_demand")
    work.run_suite("clang")


def tidy(work):
    configure_clang(work)
    # Generated headers must exist before their includers are read.
    work.call("ninja", "-C", "build/clang", "trocar_proto")
    folders = ("common/*.cpp", "server/*.cpp", "client/*.cpp")
    files = subprocess.check_output(["git", "ls-files", *folders], cwd=ROOT, text=True).splitlines()
    failed = 0
    with ThreadPoolExecutor(CORES) as pool, open(work.out / "tidy.txt", "w") as report:
        for done in pool.map(lambda file: subprocess.run(["clang-tidy", "-p", "build/clang", "--quiet", file], cwd=ROOT,
                                                         text=True, capture_output=True), files):
            failed += done.returncode != 0
            said = done.stdout + (done.stderr if done.returncode else "")  # else it only counts what it left out
            report.write(said)
            print(said, end="", flush=True)
    if failed:
        raise Failed(1, f"clang-tidy warns of {failed} files, see {work.out}/tidy.txt")


def swept(work):
    work.build("release", "contact_scenes_test")
    each = 10000 // CORES // 20 * 20 + 20
    codes = work.side_by_side(
        [["build/release/tests/contact_scenes_test", "--gtest_filter=Swept.Random*"]] * CORES, to="swept-{}.txt",
        env=lambda number: {"TROCAR_SWEPT_FIRST": str(number * each), "TROCAR_SWEPT_MOTIONS": str(each)})
    texts = [Path(work.path(f"swept-{number}.txt")).read_text() for number in range(CORES)]
    said = [line for text in texts for line in text.splitlines() if "motion" in line]
    (work.out / "table.md").write_text("".join(f"- {line}\n" for line in said))
    print("\n".join(said))
    if any(codes):
        raise Failed(1, f"a tool entered the wall, see {work.out}")


def cuts(work):
    work.build("release", "cut_campaign")
    organs = ["regular"]
    for name, otherwise in (("liver_tiny", "box"), ("liver_coarse", "liver"), ("stomach_wall", "stomach"),
                            ("gallbladder_wall", "slab")):
        file = Path(work.options.organs or "") / f"{name}.msh"
        if work.options.organs and file.exists():
            organs.append(str(file))
        else:
            print(f"deploy/campaign: {name}.msh: not given, {otherwise} instead", flush=True)
            organs.append(otherwise)
    tables = [work.path(f"cuts-{part}-of-{CORES}.csv") for part in range(CORES)]
    each = str(max(1, work.options.cuts // len(organs)))
    codes = work.side_by_side([[f"{BIN}/cut_campaign", "run", *organs, "--cuts", each, "--part", str(part), "--parts",
                                str(CORES), "--csv", table] for part, table in enumerate(tables)], to="cuts-{}.txt")
    # 1 only says that a part by itself does not keep the laws.
    if any(code not in (0, 1) for code in codes):
        raise Failed(1, f"a part of the cuts has ended early (codes {codes}), see {work.out}")
    work.call(f"{BIN}/cut_campaign", "table", *tables, to="table.md", why=f"a law of cuts is broken, see {work.out}")


def fuzz(work):
    work.build("clang-fuzz", "fuzz")
    readers = sorted(folder.name for folder in (ROOT / "tests/fuzz/seeds").iterdir() if folder.is_dir())
    for row in work.out.glob("row-*.md"):
        row.unlink()
    seconds = str(max(1, work.options.minutes * 120 // len(readers)))  # two at a time
    with ThreadPoolExecutor(2) as pool:
        codes = list(pool.map(lambda reader: subprocess.call(["deploy/lib/fuzz", reader, seconds, str(work.out)],
                                                             cwd=ROOT), readers))
    head = "| reader | executions | executions/s | edges at first | edges at last | corpus | findings |\n"
    rows = [row.read_text() for row in sorted(work.out.glob("row-*.md"))]
    (work.out / "fuzz.md").write_text("".join([head, "|---|---|---|---|---|---|---|\n", *rows]))
    print(f"deploy/campaign: the table is in {work.out}/fuzz.md")
    if any(codes):
        raise Failed(1, f"a reader is broken, see {work.out}")


def snapshots(work):
    work.build("release", "snapshot_campaign")
    work.call(f"{BIN}/snapshot_campaign", "--count", str(work.options.count), "--seed", str(work.options.seed or 1),
              to="table.md", why="a state was not read, or went on otherwise")


def faults(work):
    work.build("release", "all")
    # Brings the library that reads recordings beside our own.
    work.call("tests/conformance/run_conformance.sh", f"{ROOT}/build/release/tests/conformance/npm",
              f"{ROOT}/build/release/tests/write_sample_journals", codes=(0, 77))
    lines, failed = [], False
    for name, count in (("readonly", 1), ("disk", 1), ("clock", 1), ("sleep", 60), ("clients", 20), ("resumes", 20),
                        ("kills", work.options.count)):
        code = work.call("deploy/lib/faults", name, str(count), str(work.out), to=f"{name}.txt", codes=range(256))
        failed = failed or code not in (0, 77)
        lines += (work.out / f"{name}.txt").read_text().splitlines()
    (work.out / "table.md").write_text("".join(f"- {line}\n" for line in lines if line))
    if failed:
        raise Failed(1, f"a promise was broken, see {work.out}")


def soak(work):
    work.build("release", "trocar-hall", "trocar-server", "trocar-client", "trocar-journal")
    seconds = 60 if work.options.short else work.options.hours * 3600
    work.call("deploy/lib/soak", f"{seconds:g}", str(work.out), f"{ROOT}/build/release",
              why=f"a law is broken, see {work.out}")


def hour(work):
    work.build("release", "bench_hour")
    (work.out / "hour.mcap").unlink(missing_ok=True)
    work.call(f"{BIN}/bench_hour", "--minutes", str(work.options.minutes), "--journal", work.path("hour.mcap"),
              "--rest", "5", "--return", "20", to="hour.md",
              why=f"the recording does not verify, see {work.out}/hour.md")
    work.call("gnuplot", "-c", "tests/bench/hour.gp", str(work.out), why=f"gnuplot could not draw {work.out}/hour.md")


def page(work):
    work.build("release", "trocar-server", "trocar-client", "trocar-web", "trocar-impair", "trocar-sim", "web_page",
               "frame_crcs", web=True)
    work.call("tests/web/run_web.sh", "recording", "build/release", "build/release/tests/web/recording")
    work.call("tests/web/run_web.sh", "figures", "build/release", work.path("work"))
    work.call("tests/web/run_web.sh", "hour", "build/release", work.path("hour"))
    tables = [(work.out / file).read_text() for file in ("work/figures.md", "hour/hour.md")]
    (work.out / "page.md").write_text("".join(tables))


def validate(work):
    work.call("deploy/validate", "--out", str(work.out), *work.yes(),
              why=f"a bound is broken, see {work.out}/report.html")


# In the order in which `all` runs them: what says most in an hour first, and what shares a build together.
PARTS = {part.name: part for part in (
    Part("tests", tests, 0.5, "the tests that no change has to wait for: short forms of soak, faults and validation, "
         "the model of the ownership rules, long runs, a smoke test of the benchmarks. Builds all that only campaigns "
         "and benchmarks use"),
    Part("swept", swept, 0.3, "10,000 random motions of a tool across a hollow stomach: none may enter its wall"),
    Part("cuts", cuts, 0.5, "10,000 random cuts of five organs in fresh series of 1 to 100: after each the mesh must "
         "be sound, and in all the wounds as large as what was swept; one table. Goes on where it was stopped",
         options=("cuts", "organs"), length="cuts", amount=10000),
    Part("snapshots", snapshots, 0.5, "4,000 states of random sessions in seven scenes, cut, torn, held, "
         "loaded: each must be read again and go on bit for bit; one table",
         options=("count", "seed"), length="count", amount=4000),
    Part("faults", faults, 0.5, "servers and clients killed, stopped, without disk and with a clock that jumps: 200 "
         "recordings cut short, one session resumed 20 times; each promise of the documents is checked",
         setup=("--with-node",), options=("count",), length="count", amount=200),
    Part("soak", soak, 1, "lessons of several kinds one after the other on a hall, beside a session that lasts all "
         "the time: memory and descriptors have to stay what they were, each recording has to verify, and nothing may "
         "be left; one table", options=("hours", "short"), length="hours", amount=1, table="soak.md"),
    Part("page", page, 0.4, "the page for browsers: bytes, first picture, pictures per second, seeks, watchers, and "
         "the age of the picture over bad networks, and a recording of an hour; one table",
         setup=("--with-web",), table="page.md"),
    Part("hour", hour, 3, "an hour of simulated time in which two blades cut and a grasper draws the wounds open, with "
         "a rest every five minutes and a return to the mark every twenty: a table of what a tick, a frame, the memory "
         "and the recording take by then, and hour.svg; the recording is verified", options=("minutes",), length="minutes", amount=60, table="hour.md"),
    Part("validate", validate, 3, "deploy/validate in full: every experiment of the papers",
         table=""),
    Part("sanitized", sanitized, 0.5, "all tests of what outside data reaches, by clang with address and "
         "undefined-behaviour sanitizers; deploy/test does so for readers and decoders alone", setup=("--with-clang",)),
    Part("fuzz", fuzz, 1, "libFuzzer on every decoder of outside data, two at a time; one table. What it has learnt "
         "stays in --out and is where the next run begins",
         setup=("--with-clang",), options=("minutes",), length="minutes", amount=60, table="fuzz.md", keeps=True),
    Part("mutants", mutants.run, 0.5, "a dozen mistakes, such as a wrong sign or a missing check, made in the product one "
         "after the other: a test that every change has to pass must find each; one table"),
    Part("clang", clang, 1.5, "everything built by clang, each source by itself, and all tests: the same state hashes "
         "as with gcc", setup=("--with-clang",)),
    Part("tidy", tidy, 1, "clang-tidy over all sources; a warning is an error", setup=("--with-clang",), table=""),
    Part("tsan", tsan, 3, "all tests that need no display, built with the thread sanitizer"),
)}
