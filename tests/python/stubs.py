"""Writes the stubs of the module trocar as it is: python3 stubs.py > server/python/trocar/__init__.pyi"""

import inspect
import re

import trocar

HEAD = '''"""{doc}"""

import os
from typing import List, Optional, Union

import numpy

__version__: str


class Error(RuntimeError):
    """{error}"""

    code: str
'''


def signature_and_doc(text):
    first, _, rest = (text or "").partition("\n")
    first = re.sub(r"\bself: [\w.]+", "self", first).replace("trocar.", "").replace("os.PathLike", "Union[str, os.PathLike]")
    if not first.endswith(("None", "]", "str", "int", "float", "bool")) and "->" not in first:
        first += " -> None"
    return first, rest.strip()


def quoted(doc, indent):
    return '"""' + doc.replace("\n", "\n" + " " * indent).replace("\n" + " " * indent + "\n", "\n\n") + '"""'


def members(kind):
    for name, member in sorted(vars(kind).items()):
        if name.startswith("_") and name not in ("__init__", "__iter__", "__next__", "__enter__",
                                                 "__exit__"):
            continue
        is_static = isinstance(member, staticmethod)
        if isinstance(member, property):
            first, _ = signature_and_doc(member.fget.__doc__)
            yield f"    @property\n    def {name}(self) -> {first.split('-> ')[-1]}:"
            doc = inspect.getdoc(member)
        else:
            function = member.__func__ if is_static else member
            if not (function.__doc__ or "").startswith(name + "("):
                continue  # no constructor
            first, doc = signature_and_doc(function.__doc__)
            first = first.replace("*args", "*args: object")
            yield ("    @staticmethod\n" if is_static else "") + f"    def {first}:"
        yield f"        {quoted(doc, 8)}\n" if doc else "        ...\n"


def stubs():
    lines = [HEAD.format(doc=trocar.__doc__, error=trocar.Error.__doc__)]
    for name, kind in sorted(vars(trocar).items()):
        if inspect.isclass(kind) and name != "Error":
            lines += [f"\nclass {name}:", f"    {quoted(kind.__doc__, 4)}\n", *members(kind)]
        elif inspect.isbuiltin(kind):
            first, doc = signature_and_doc(kind.__doc__)
            lines += [f"\ndef {first}:", f"    {quoted(doc, 4)}\n"]
    return "\n".join(lines)


if __name__ == "__main__":
    print(stubs(), end="")
