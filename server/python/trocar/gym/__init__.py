"""Tasks for what learns, with the interface of Gymnasium, which need not be installed.

    import trocar.gym
    env = trocar.gym.make("trocar/Press-v0")
    observation, info = env.reset(seed=1)
    observation, reward, terminated, truncated, info = env.step(env.action_space.sample())

Where Gymnasium is installed, tasks are of its classes, and registered: gymnasium.make() takes the same names."""

from functools import partial

from trocar.gym.base import STEP_S, TICKS, Task, flatten
from trocar.gym.lessons import TOOLS, LessonTask
from trocar.gym.tasks import CutLine, Dissect, Lift, Press, Reach
from trocar.gym.vector import VectorEnv

__all__ = ["CutLine", "Dissect", "LessonTask", "Lift", "Press", "Reach", "STEP_S", "TASKS", "TICKS", "Task",
           "VectorEnv", "flatten", "make"]


def _name(lesson):
    return "".join(word.capitalize() for word in lesson.split("-"))


# By name: what makes it.
TASKS = {f"trocar/{task.__name__}-v0": task for task in (Reach, Press, Lift, CutLine, Dissect)}
TASKS.update({f"trocar/{_name(lesson)}-v0": partial(LessonTask, lesson=lesson) for lesson in TOOLS})


def make(name, **options):
    """The task of a name such as "trocar/Press-v0"; `options` are those of its class. Raises ValueError for a name
    that there is not, and lists those that there are."""
    if name not in TASKS:
        raise ValueError(f"name: there is no {name!r}, take one of {', '.join(TASKS)}")
    return TASKS[name](**options)


def _register():
    try:
        from gymnasium.envs.registration import register
    except ImportError:
        return
    for name in TASKS:
        register(id=name, entry_point=partial(make, name))


_register()
