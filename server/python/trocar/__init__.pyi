"""Soft tissue that hands push, grasp and cut: organs, lessons, scenarios, sessions and recordings.

Lengths are in m, forces in N, masses in kg; a tick is 1 ms. Arrays are read-only."""

import os
from typing import List, Optional, Union

import numpy

__version__: str


class Error(RuntimeError):
    """A file, scenario or recording cannot be used. The text is one line with file, field and limit; `code` is a word such as "bad file"."""

    code: str


class Frame:
    """The surface of a recording at a tick."""

    @property
    def positions(self) -> numpy.ndarray:
        """Vertex positions, m, world frame, on a grid of 32 um; float32 (vertices x 3)."""

    @property
    def tick(self) -> int:
        """Ticks since the session began."""

    @property
    def triangles(self) -> numpy.ndarray:
        """Vertex numbers, counterclockwise from outside; uint32 (triangles x 3)."""


class FrameIterator:
    """Frames of a recording, in order."""

    def __iter__(self) -> object:
        """Returns itself."""

    def __next__(self) -> Frame:
        """The next frame."""


class Lesson:
    """A lesson: an organ with structures in it, and stages with a goal each.

    Lesson("find-the-lump") is one that the programs bring, see lessons(); Lesson("file.toml") a file. Raises Error with file, line and key."""

    def __init__(self, spec: str) -> None:
        ...

    @property
    def bleeds(self) -> bool:
        """Whether what is cut bleeds."""

    def organ(self) -> Organ:
        """Its organ with the structures in it, for Session(organ, lesson=lesson)."""

    @property
    def organ_name(self) -> str:
        """A built-in organ's name, or a file's path."""

    @property
    def stages(self) -> list:
        """Dicts of name, text, goal (find, follow, lift, hold, incise, remove or carry), line (points, m), limit_s, force_limit_n (0: none) and hands."""

    @property
    def text(self) -> str:
        """What people read."""

    @property
    def title(self) -> str:
        """What people read."""


class Organ:
    """An organ: mesh, material and what holds it. It never changes.

    Organ("liver") is a built-in one (liver, elastic-liver, lattice, plate, stomach, chest), Organ("file.organ") a file, Organ("file.toml") one of parts, and the path of a mesh imports it in metres; see import_mesh()."""

    def __init__(self, spec: str) -> None:
        """An organ: mesh, material and what holds it. It never changes.

        Organ("liver") is a built-in one (liver, elastic-liver, lattice, plate, stomach, chest), Organ("file.organ") a file, Organ("file.toml") one of parts, and the path of a mesh imports it in metres; see import_mesh()."""

    @property
    def fixed_nodes(self) -> numpy.ndarray:
        """Nodes that are held, ascending; uint32, read-only view."""

    @property
    def hash(self) -> int:
        """XXH3-64 over all that makes a difference to a result."""

    @staticmethod
    def import_mesh(path: Union[str, os.PathLike], *, unit: str = 'm', nodes: Optional[int] = None, name: Optional[str] = None) -> Organ:
        """Imports a mesh, a surface or a label map, whose lengths are in `unit` (m, cm or mm). A surface or a label map is filled with about `nodes` nodes. What was repaired comes as warnings. Raises Error."""

    @property
    def mass(self) -> float:
        """Mass of all nodes, kg."""

    @property
    def name(self) -> str:
        """Name of the organ, or its file's without its end."""

    @property
    def node_masses(self) -> numpy.ndarray:
        """kg per node; float64, read-only view."""

    @property
    def nodes(self) -> numpy.ndarray:
        """Rest positions, m, world frame; float64 (nodes x 3), read-only view."""

    @property
    def regions(self) -> dict:
        """Node numbers of each part or region by its name, ascending; uint32."""

    def save(self, path: Union[str, os.PathLike]) -> None:
        """Writes an .organ file; it is whole or not there. Raises Error."""

    @property
    def source(self) -> str:
        """One line: where it comes from."""

    @property
    def surface(self) -> numpy.ndarray:
        """Node numbers of each boundary triangle, counterclockwise from outside; uint32 (triangles x 3), read-only view."""

    @property
    def tets(self) -> numpy.ndarray:
        """Node numbers of each tet; uint32 (tets x 4), read-only view."""

    @property
    def ties(self) -> dict:
        """Places that ties hold to one another at rest, m, by the name of their table; float64 (ties x 2 x 3)."""

    @property
    def volume(self) -> float:
        """Volume of its tets at rest, m^3."""


class Recording:
    """A recorded session or scenario (.mcap). Nothing is simulated.

    Use it by `with`, or close() it. Raises Error where it is damaged."""

    def __enter__(self) -> object:
        """Returns itself."""

    def __exit__(self, *args: object) -> None:
        """Closes the file."""

    def __init__(self, path: Union[str, os.PathLike]) -> None:
        ...

    def close(self) -> None:
        """Closes the file. Everything else raises ValueError then."""

    def events(self) -> list:
        """Claims and changes of the list of participants, by tick: dicts of tick, kind, tool (slot: participant x 2 + number), what and verb."""

    def frames(self, start: int = 0, stop: Optional[int] = None) -> FrameIterator:
        """Iterates over frames with a tick from `start` to before `stop`."""

    @property
    def is_finished(self) -> bool:
        """False: it was cut short, or repaired."""

    @property
    def last_tick(self) -> int:
        """Tick of the last message."""

    def organ(self) -> Organ:
        """The organ as it was at first."""

    @property
    def organ_name(self) -> str:
        """Name of the organ."""

    @property
    def participants(self) -> list:
        """Who was ever in: dicts of slot and name."""

    def seek(self, tick: int) -> Frame:
        """The frame at or before a tick."""

    @property
    def sim_version(self) -> int:
        """Version of the simulation; another one gives other hashes."""

    @property
    def start_utc_ns(self) -> int:
        """Time of tick 0, ns since 1970 (UTC)."""

    @property
    def summary(self) -> str:
        """One line for people."""

    def tick_hashes(self) -> numpy.ndarray:
        """State hash after each recorded tick; uint64 (ticks)."""

    def ticks(self) -> numpy.ndarray:
        """The ticks that tick_hashes() is of; uint64 (ticks)."""

    def tools(self) -> dict:
        """A row for each tool of each frame, as columns for pandas.DataFrame: tick, tool (slot), verb, tip (m), orientation (quaternion), force of the tissue on it (N), nodes in contact."""


class Scenario:
    """An organ, loads and scripted tools over time, as trocar-sim runs it.

    Scenario(path) reads a .toml file. Raises Error with file, line and key."""

    def __init__(self, path: Union[str, os.PathLike]) -> None:
        ...

    @staticmethod
    def parse(text: str, source: str = 'scenario') -> Scenario:
        """Reads the text of such a file; `source` stands for its path, in messages and for files relative to it."""

    @property
    def probes(self) -> List[str]:
        """Names of its probes."""

    def run(self, *, solver: str = 'live', threads: int = 1, callback: object = None) -> ScenarioResult:
        """Runs it from the start and returns a ScenarioResult; it can be run again.

        `solver`: live, the sweeps of a session, or full, every step to the tolerance in [run]. Results do not depend on `threads`, 1 to 64. `callback(time_s)` is called after each step; what it raises ends the run, and so does Ctrl-C."""

    @property
    def seconds(self) -> float:
        """Simulated time of a whole dynamic run, s."""


class ScenarioResult:
    """Probes and final state of a scenario that has run."""

    @property
    def organ(self) -> Organ:
        """The organ with the scenario's materials, at rest."""

    @property
    def positions(self) -> numpy.ndarray:
        """Node positions at the end, m, world frame; float32 (nodes x 3)."""

    @property
    def rejected_nodes(self) -> int:
        """Nodes that had no finite step, over all steps."""

    @property
    def seconds(self) -> float:
        """Simulated time at the end, s."""

    @property
    def state_hash(self) -> Optional[int]:
        """The last of tick_hashes; None without ticks."""

    @property
    def thread_positions(self) -> dict:
        """By [[thread]]: positions of its nodes at the end, from its start, m, world frame; float64 (nodes x 3). Nodes are 1 mm apart at rest."""

    @property
    def thread_tensions(self) -> dict:
        """By [[thread]]: tension between each node and the next at the end, N, 0 where it is cut, negative where it is pressed; float64 (nodes - 1)."""

    @property
    def tick_hashes(self) -> numpy.ndarray:
        """State hash after each tick, as a recording of trocar-sim --journal has it; uint64 (ticks). Empty for static runs and the explicit integrator."""

    @property
    def times(self) -> dict:
        """By probe: s at which it has a value; float64 (rows)."""

    @property
    def unconverged_steps(self) -> int:
        """Steps that did not reach the tolerance in [run]."""

    @property
    def values(self) -> dict:
        """By probe: m, m/s or N, along x, y, z; float64 (rows x 3)."""


class Session:
    """An organ and hands, without network: a tick is 1 ms of simulated time.

    Results do not depend on `threads`, 1 to 64. While one thread is in step() others may not use the session: that raises Error. With a `lesson`, whose organ() it is, the session takes its course, see course()."""

    def __init__(self, organ: Organ, *, threads: int = 1, lesson: Optional[Lesson] = None) -> None:
        ...

    def answer(self, hand: int = 0, *, tool: int = 0) -> str:
        """Says "it is here", with the tip of a tool as the newest frame has it; returns right, wrong, not asked or no tissue."""

    def counts(self) -> dict:
        """Dict of nodes, tets, triangles, wound_triangles, pieces (that cuts have set free), edits (cuts and tears) and ties (that hold)."""

    def course(self) -> dict:
        """How far the lesson is: dict of stage, stages, is_over, progress (of the goal, 0 to 1), seconds, is_too_strong, points (0 to 100), target (m, or None) and results, a dict of is_reached, points and measures for each stage that is over. Raises Error without one."""

    def force(self, hand: int = 0, *, tool: int = 0) -> numpy.ndarray:
        """Force of the tissue on a tool after the last tick, N, world frame; float32 (3)."""

    def incision(self, line: sequence, *, depth: float, tolerance: float) -> dict:
        """What is cut along a line of 2 to 32 points at rest, m, to a depth towards the organ's centre, m, as lessons measure it: dict of covered (0 to 1), error (mean distance of the wound from the line, m) and stray (wound farther away than the tolerance, m^2)."""

    def is_at_work(self, hand: int = 0, *, tool: int = 0) -> bool:
        """Whether its push, grasp or cut is in effect."""

    def leave(self, hand: int) -> None:
        """The hand leaves in the next tick; what it held is set free."""

    def next_stage(self) -> None:
        """Goes on to the next stage; the goal of this one counts as not reached."""

    def pose(self, hand: int = 0, *, tool: int = 0) -> numpy.ndarray:
        """Where a tool is: x, y, z of its tip, m, and its quaternion x, y, z, w, world frame; float32 (7). Its shaft is along z of its own frame."""

    @property
    def positions(self) -> numpy.ndarray:
        """Node positions, m, world frame; float32 (nodes x 3), a read-only view that shows the newest state after each step(). A cut makes nodes: then ask for it again, the old one stays as it was."""

    def put(self, hand: int, position: object, verb: str = 'push', *, tool: int = 0, shaft: object = None, orientation: object = None) -> None:
        """Puts the tip of a hand's tool at `position`, m, world frame, from the next tick on; it walks there in 10 ticks and stays until it is put elsewhere.

        `hand` 0 to 15 joins by it, `tool` is 0 or 1, `verb` none, push, grasp or cut. `shaft` is the direction from the tip along the shaft, up without it; `orientation` a quaternion x, y, z, w in its place."""

    @property
    def rest_positions(self) -> numpy.ndarray:
        """Rest positions of all nodes, m, world frame; float64 (nodes x 3)."""

    def restore(self, state: bytes) -> None:
        """Goes on from a state that save() gave; a lesson begins anew. Raises Error, and keeps its own state, where the bytes are not one of this organ."""

    def save(self) -> bytes:
        """The whole state, to restore() it in a session of an equal organ."""

    def state_hash(self) -> int:
        """XXH3-64 of the state as it is."""

    def step(self, ticks: int = 1, *, callback: object = None) -> None:
        """Simulates `ticks` ticks; other threads of Python run meanwhile. `callback(tick)` is called after each; what it raises, and Ctrl-C, end it between two ticks."""

    def take(self, hand: int, *, tool: int = 0, form: str = 'plain', radius: float = 0.005, length: float = 0.3, reach: float = 0.01, half_width: float = 0, friction: float = 0.2, grip: float = 8, edge: float = 0.02) -> None:
        """Gives a hand another instrument, from the next tick on; lengths in m, grip in N."""

    @property
    def tets(self) -> numpy.ndarray:
        """Node numbers of each tet as it is now; uint32 (tets x 4)."""

    @property
    def tick(self) -> int:
        """Ticks done."""

    @property
    def tick_hash(self) -> int:
        """State hash of the last tick, as recordings have it."""

    def tip(self, hand: int = 0, *, tool: int = 0) -> numpy.ndarray:
        """Where a tool's tip is, m, world frame; float32 (3). It is on its way to what was put."""

    @property
    def triangles(self) -> numpy.ndarray:
        """Node numbers of each boundary triangle as it is now, outward; uint32 (triangles x 3)."""

    @property
    def velocities(self) -> numpy.ndarray:
        """Node velocities, m/s; float32 (nodes x 3), as positions."""

    @property
    def wounds(self) -> numpy.ndarray:
        """Whether a blade made each of `triangles`; bool (triangles)."""


def lessons() -> List[str]:
    """Names of the lessons that the programs bring."""
