"""What all tasks share: an organ, tools that walk as an action says, observations, seeds and pictures.

A step is 16 ticks, 16 ms of simulated time. An action has four numbers for each tool, from -1 to 1: the way of its
tip along x, y and z, of which 1 is a millimetre, and whether it is used (above 0) or not; tasks whose tool is always
used leave that one out. Equal seeds and equal actions give equal observations and state hashes, to the bit."""

import numpy as np

import trocar
from trocar import picture

try:
    from gymnasium import Env
    from gymnasium.spaces import Box, Dict
except ImportError:
    from trocar.gym.spaces import Box, Dict, Env

TICKS = 16  # of a step
STEP_S = 0.001 * TICKS
STEP_M = 0.001  # that an action of 1 moves a tip
SAMPLES = 64  # nodes of the surface in an observation

# What each instrument is used for, and its shape: as the programs' own have them (common/tool/instruments.toml), but
# for the knife, a scalpel with a long edge.
INSTRUMENTS = {
    "probe": ("push", {"form": "probe", "radius": 0.005, "friction": 0.05, "grip": 0, "edge": 0}),
    "grasper": ("grasp", {"form": "grasper", "radius": 0.0025, "friction": 0.3, "reach": 0.01, "grip": 8, "edge": 0}),
    "scalpel": ("cut", {"form": "scalpel", "radius": 0.0015, "friction": 0.1, "grip": 0, "edge": 0.015}),
    "knife": ("cut", {"form": "scalpel", "radius": 0.0015, "friction": 0.1, "grip": 0, "edge": 0.08}),
}

_organs = {}


def organ_of(spec):
    """The organ of a name or a path; it is made once, as it never changes."""
    if isinstance(spec, trocar.Organ):
        return spec
    if spec not in _organs:
        _organs[spec] = trocar.Organ(spec)
    return _organs[spec]


def outward(organ):
    """Nodes of an organ's surface, ascending, and unit normals at them, outward; float64 (nodes x 3)."""
    triangles = organ.surface.astype(np.int64)
    corners = organ.nodes[triangles]
    normals = np.zeros_like(organ.nodes)
    np.add.at(normals, triangles.ravel(), np.repeat(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), 3, axis=0))
    nodes = np.unique(triangles)
    return nodes, normals[nodes] / np.linalg.norm(normals[nodes], axis=1)[:, None]


def flatten(observation):
    """An observation as one vector, float32, its keys in alphabetical order; of a picture, its values from 0 to 1."""
    if isinstance(observation, dict):
        return np.concatenate([np.ravel(observation[key]) for key in sorted(observation)]).astype(np.float32)
    return np.ravel(observation).astype(np.float32) / 255


class Task(Env):
    """A task on an organ; subclasses say where tools begin, what is rewarded, and when it is over.

    organ          a built-in organ's name, a file or an Organ; the task's own without it
    observation    "state": a dict of float32 arrays, or "picture": uint8 (height x width x 3)
    render_mode    None, or "rgb_array": render() gives a picture
    seconds        simulated time after which an episode is truncated
    size           width and height of pictures, pixels

    State has: pose (tools x 7: tip in m, quaternion x, y, z, w), force (tools x 3: of the tissue on each tool, N),
    surface (64 x 3: nodes of the surface, m), counts (nodes, tets, boundary triangles, free pieces) and goal, which
    the task explains. `info` has tick, state_hash and is_success, and measures of the task with their units."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 62}
    organ_name = "liver"
    instruments = ("probe",)  # of tool 0, 1, ...: two to a hand
    is_always_used = True
    goal_size = 0
    view = {"eye": (0, 0.08, 0.42), "look_at": (0, 0, 0), "up": (0, 1, 0)}

    def __init__(self, *, organ=None, observation="state", render_mode=None, seconds=6.0, size=(128, 96)):
        if observation not in ("state", "picture"):
            raise ValueError(f"observation: is {observation!r}, must be 'state' or 'picture'")
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode: is {render_mode!r}, must be None or 'rgb_array'")
        if not STEP_S <= seconds <= 3600:
            raise ValueError(f"seconds: is {seconds}, must be {STEP_S} to 3600 s")
        self.organ = organ_of(self.organ_name if organ is None else organ)
        self.render_mode = render_mode
        self.session = self._new_session()
        self._start = self.session.save()
        self._observes_picture = observation == "picture"
        self._most_steps = int(round(seconds / STEP_S))
        self._size = size
        surface = np.unique(self.organ.surface)
        self._sampled = surface[np.linspace(0, len(surface) - 1, SAMPLES).astype(int)]
        low = self.organ.nodes.min(axis=0) - 0.1
        self.workspace = np.stack([low, self.organ.nodes.max(axis=0) + 0.1])
        self._tips = np.zeros((len(self.instruments), 3))
        self._shafts = np.zeros((len(self.instruments), 3))
        self._goal = np.zeros(self.goal_size)
        self._steps = None  # None: reset() comes first
        self._is_over = False
        per_tool = 3 if self.is_always_used else 4
        self.action_space = Box(-1, 1, (per_tool * len(self.instruments) + self._more_actions(),), np.float32)
        self.observation_space = self._make_observation_space()

    # What a task says.

    def _begin(self):
        """Chooses a goal out of self.np_random, and gives tip and shaft of each tool."""
        raise NotImplementedError

    def _look(self):
        """Reward, whether the task is done, and measures, after a step."""
        raise NotImplementedError

    def _new_session(self):
        return trocar.Session(self.organ)

    def _more_actions(self):
        return 0

    def _instrument_of(self, tool):
        return self.instruments[tool]

    def _use_more(self, numbers):
        """Takes the numbers of an action that are of no tool."""

    # What Gymnasium asks for.

    def reset(self, *, seed=None, options=None):
        """Begins an episode; returns an observation and `info`. Raises ValueError for a seed that is no whole number
        of 0 or more, and for options, of which there are none."""
        if seed is not None and (isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or seed < 0):
            raise ValueError(f"seed: is {seed!r}, must be None or a whole number of 0 or more")
        if options:
            raise ValueError(f"options: has {sorted(options)[0]!r}, this task has none")
        super().reset(seed=None if seed is None else int(seed))
        self.session.restore(self._start)
        self._steps, self._is_over = 0, False
        for tool, (tip, shaft) in enumerate(self._begin()):
            self._tips[tool], self._shafts[tool] = tip, shaft
            self._take(tool)
            self._put(tool, "none")
        self.session.step(TICKS)
        return self._observe(), self._info({"is_success": False})

    def step(self, action):
        """Simulates 16 ms; returns observation, reward, terminated, truncated and `info`.

        Raises ValueError where the action has another shape, is not finite, or is beyond -1 to 1."""
        action = self._checked(action)
        per_tool = 3 if self.is_always_used else 4
        of_tools = action[:per_tool * len(self.instruments)].reshape(len(self.instruments), per_tool)
        self._tips = np.clip(self._tips + STEP_M * of_tools[:, :3], *self.workspace)
        for tool, numbers in enumerate(of_tools):
            is_used = self.is_always_used or numbers[3] > 0
            self._put(tool, INSTRUMENTS[self._instrument_of(tool)][0] if is_used else "none")
        self._use_more(action[per_tool * len(self.instruments):])
        self.session.step(TICKS)
        self._steps += 1
        reward, is_done, measures = self._look()
        self._is_over = is_done or self._steps >= self._most_steps
        return self._observe(), float(reward), bool(is_done), not is_done and self._is_over, self._info(measures)

    def render(self):
        """A picture, uint8 (height x width x 3), where render_mode is "rgb_array", else None."""
        return self._draw() if self.render_mode == "rgb_array" else None

    def close(self):
        """Ends it; step() needs a reset() then."""
        self._steps = None

    # How that is done.

    def _checked(self, action):
        if self._steps is None or self._is_over:
            raise ValueError("action: no episode is on, call reset() first")
        try:
            action = np.asarray(action, float)
        except (TypeError, ValueError):
            raise ValueError(f"action: must be {self.action_space.shape[0]} numbers") from None
        if action.shape != self.action_space.shape:
            raise ValueError(f"action: has shape {action.shape}, must have {self.action_space.shape}")
        if not np.isfinite(action).all():
            raise ValueError(f"action: number {int(np.flatnonzero(~np.isfinite(action))[0])} is not finite, "
                             "each must be -1 to 1")
        worst = int(np.argmax(np.abs(action)))
        if abs(action[worst]) > 1:
            raise ValueError(f"action: number {worst} is {action[worst]:g}, each must be -1 to 1")
        return action

    def _take(self, tool):
        self.session.take(tool // 2, tool=tool % 2, **INSTRUMENTS[self._instrument_of(tool)][1])

    def _put(self, tool, verb):
        self.session.put(tool // 2, self._tips[tool], verb, tool=tool % 2, shaft=self._shafts[tool])

    def tip(self, tool=0):
        """Where a tool's tip is, m; float64 (3)."""
        return self.session.tip(tool // 2, tool=tool % 2).astype(float)

    def force(self, tool=0):
        """Force of the tissue on a tool, N; float64 (3)."""
        return self.session.force(tool // 2, tool=tool % 2).astype(float)

    def is_at_work(self, tool=0):
        """Whether what a tool was asked for is in effect."""
        return self.session.is_at_work(tool // 2, tool=tool % 2)

    def _make_observation_space(self):
        if self._observes_picture:
            return Box(0, 255, (self._size[1], self._size[0], 3), np.uint8)
        tools = len(self.instruments)
        shapes = {"pose": (tools, 7), "force": (tools, 3), "surface": (SAMPLES, 3), "counts": (4,),
                  "goal": (self.goal_size,)}
        return Dict({key: Box(-np.inf, np.inf, shape, np.float32) for key, shape in shapes.items()})

    def _observe(self):
        if self._observes_picture:
            return self._draw()
        tools = range(len(self.instruments))
        counts = self.session.counts()
        return {"pose": np.stack([self.session.pose(t // 2, tool=t % 2) for t in tools]),
                "force": np.stack([self.session.force(t // 2, tool=t % 2) for t in tools]),
                "surface": self.session.positions[self._sampled],
                "counts": np.array([counts[key] for key in ("nodes", "tets", "triangles", "pieces")], np.float32),
                "goal": self._goal.astype(np.float32)}

    def _info(self, measures):
        return {"tick": self.session.tick, "state_hash": self.session.tick_hash, **measures}

    def _draw(self):
        tools = [(t // 2, t % 2, INSTRUMENTS[self._instrument_of(t)][1]["radius"])
                 for t in range(len(self.instruments))]
        return picture.draw_session(self.session, tools, width=self._size[0], height=self._size[1], **self.view)
