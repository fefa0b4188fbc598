"""The programs' lessons as tasks: their organs, goals, limits and points (docs/lessons.md)."""

import numpy as np

import trocar
from trocar.gym.base import Task

# The instruments of each lesson's tools, and another one that tool 0 takes in a later stage.
TOOLS = {
    "find-the-lump": (("probe",), {}),
    "follow-the-point": (("probe",), {}),
    "lift-gently": (("grasper",), {}),
    "along-the-line": (("scalpel",), {}),
    "hold-for-another": (("grasper", "grasper", "scalpel"), {}),
    "take-it-out": (("probe",), {1: "scalpel"}),
    "move-the-rings": (("grasper", "grasper"), {}),
}


class LessonTask(Task):
    """A lesson that the programs bring, or a file's.

    An action has one number more than those of the tools: above 0 it says "it is here", with the tip of tool 0, once
    for each time that it comes to be above 0. goal (11): the point to follow, or where a piece has to be, less the tip
    of tool 0, m (0 without one); both ends of the line to follow or cut along, or of a piece's way, less that tip, m (0
    without one); the stage's number; how far its goal is, 0 to 1. Reward of a step: 10 p + P / 10, p how much nearer the stage's goal is (0 to
    1) and P the points of a stage (0 to 100) that is over with it, less 0.1 while the force is above the stage's
    limit. It is over with the last stage. Measures: stage, points, answer."""

    is_always_used = False
    goal_size = 11

    def __init__(self, *, lesson, tools=None, **options):
        if tools is None and lesson not in TOOLS:
            raise ValueError(f"tools: say which instruments {lesson!r} needs, such as ('grasper', 'scalpel')")
        self._lesson = trocar.Lesson(lesson)
        self.instruments, self._later = TOOLS[lesson] if tools is None else (tuple(tools), {})
        self._stages = self._lesson.stages
        self._stage = 0
        if self._lesson.organ_name == "pegs":
            self.view = {"eye": (0, 0.16, 0.24), "look_at": (0, 0, 0), "up": (0, 1, 0)}
        # The lesson itself ends by its limits.
        options.setdefault("seconds", 1 + sum(stage["limit_s"] for stage in self._stages))
        super().__init__(organ=self._lesson.organ(), **options)

    def _new_session(self):
        return trocar.Session(self.organ, lesson=self._lesson)

    def _more_actions(self):
        return 1

    def _instrument_of(self, tool):
        return self._later.get(self._stage, self.instruments[tool]) if tool == 0 else self.instruments[tool]

    def _begin(self):
        self._stage, self._was_asked, self._answer = 0, False, None
        self._course = self.session.course()
        up = np.array([0.0, 1.0, 0.3]) if self._lesson.organ_name == "pegs" else np.array([0.0, 0.3, 1.0])
        reach = self.organ.nodes.max(axis=0)[1 if up[1] == 1 else 2] + 0.02
        places = []
        for tool in range(len(self.instruments)):
            tip = self.np_random.uniform(-0.005, 0.005, 3) + up / np.linalg.norm(up) * reach
            tip[0] += 0.03 * (tool - (len(self.instruments) - 1) / 2)
            places.append((tip, up))
        self._find(places[0][0])
        return places

    def _find(self, tip):
        told = self._course
        target = np.zeros(3) if told["target"] is None else np.array(told["target"]) - tip
        line = self._stages[told["stage"]]["line"]
        ends = np.ravel([np.array(line[end]) - tip for end in (0, -1)]) if line else np.zeros(6)
        self._goal = np.concatenate([target, ends, [told["stage"], told["progress"]]])

    def _use_more(self, numbers):
        is_asked = numbers[0] > 0
        self._answer = self.session.answer() if is_asked and not self._was_asked else None
        self._was_asked = is_asked

    def _look(self):
        before, now = self._course, self.session.course()
        self._course = now
        over = now["results"][len(before["results"]):]
        nearer = now["progress"] - before["progress"] if not over else 0.0
        self._find(self.tip())
        if now["stage"] != self._stage:
            self._stage = now["stage"]
            if self._stage in self._later:
                self._take(0)
        reward = 10 * nearer + sum(result["points"] for result in over) / 10 - 0.1 * now["is_too_strong"]
        return reward, now["is_over"], {
            "is_success": now["is_over"] and all(result["is_reached"] for result in now["results"]),
            "stage": now["stage"], "points": now["points"], "answer": self._answer}
