"""Tables as Parquet files, with no other package: plain encoding, no compression, one row group.

Source: Apache Parquet format 2.10, and Thrift's compact protocol. Readers of Parquet open them."""

import struct

import numpy as np

_BOOLEAN, _INT64, _FLOAT, _BYTES = 0, 2, 4, 6
_REQUIRED, _OPTIONAL, _REPEATED = 0, 1, 2
_UTF8, _LIST = 0, 3
_PLAIN, _RLE = 0, 3


def _varint(number):
    out = bytearray()
    while number > 127:
        out.append(number & 127 | 128)
        number >>= 7
    out.append(number)
    return bytes(out)


class _I64(int):
    """A number that Thrift has 64 bits for."""


def _thrift(value):
    """Type and bytes of a value: a whole number, text, a list, or a dict of fields by their numbers."""
    if isinstance(value, int):
        return (6 if isinstance(value, _I64) else 5), _varint((value << 1) ^ (value >> 63))
    if isinstance(value, str):
        text = value.encode()
        return 8, _varint(len(text)) + text
    if isinstance(value, list):
        items = [_thrift(item) for item in value]
        kind = items[0][0]
        head = bytes([len(items) << 4 | kind]) if len(items) < 15 else bytes([0xf0 | kind]) + _varint(len(items))
        return 9, head + b"".join(data for _, data in items)
    out, before = b"", 0
    for field, item in sorted(value.items()):
        kind, data = _thrift(item)
        out += bytes([field - before << 4 | kind]) + data
        before = field
    return 12, out + b"\0"


def _runs(pairs):
    """Levels of one bit as runs, with their length before them."""
    data = b"".join(_varint(count << 1) + bytes([level]) for level, count in pairs if count)
    return struct.pack("<I", len(data)) + data


class _Leaf:
    """A column as it lies in the file."""

    def __init__(self, path, kind, count, levels, values):
        self.path, self.kind, self.count, self.data = path, kind, count, levels + values


def _plain(values):
    """Type and bytes of numbers, flags, texts or bytes."""
    if isinstance(values, np.ndarray):
        if values.dtype == bool:
            return _BOOLEAN, np.packbits(values, bitorder="little").tobytes()
        if values.dtype.kind in "iu":
            return _INT64, values.astype("<i8").tobytes()
        return _FLOAT, values.astype("<f4").tobytes()
    raw = [value.encode() if isinstance(value, str) else value for value in values]
    return _BYTES, b"".join(struct.pack("<I", len(one)) + one for one in raw)


def _column(name, values):
    """Schema elements and leaves of a column: numbers or flags (rows), vectors (rows x n), texts, or pictures as bytes
    of PNG files, which are groups of bytes and path as the package `datasets` has them."""
    if isinstance(values, np.ndarray) and values.ndim == 2:
        rows, width = values.shape
        kind, data = _plain(values.ravel())
        repeats = [(0, rows)] if width == 1 else [pair for _ in range(rows) for pair in ((0, 1), (1, width - 1))]
        levels = _runs(repeats) + _runs([(1, rows * width)])
        return ([{3: _REQUIRED, 4: name, 5: 1, 6: _LIST}, {3: _REPEATED, 4: "list", 5: 1},
                 {1: kind, 3: _REQUIRED, 4: "element"}],
                [_Leaf([name, "list", "element"], kind, rows * width, levels, data)])
    if not isinstance(values, np.ndarray) and isinstance(values[0], bytes):
        _, data = _plain(values)
        rows = len(values)
        return ([{3: _REQUIRED, 4: name, 5: 2}, {1: _BYTES, 3: _OPTIONAL, 4: "bytes"},
                 {1: _BYTES, 3: _OPTIONAL, 4: "path", 6: _UTF8}],
                [_Leaf([name, "bytes"], _BYTES, rows, _runs([(1, rows)]), data),
                 _Leaf([name, "path"], _BYTES, rows, _runs([(0, rows)]), b"")])
    kind, data = _plain(values)
    element = {1: kind, 3: _REQUIRED, 4: name}
    if kind == _BYTES:
        element[6] = _UTF8
    return [element], [_Leaf([name], kind, len(values), b"", data)]


def write(path, columns, *, metadata=None):
    """Writes columns by name, at least one row: arrays of numbers or flags, whole numbers as int64 and others as
    float32; arrays of two dimensions as lists; lists of str, or of bytes of PNG files. `metadata`: texts by name."""
    parts = [_column(name, values) for name, values in columns.items()]
    rows = len(next(iter(columns.values())))
    schema = [{4: "schema", 5: len(parts)}] + [element for elements, _ in parts for element in elements]
    chunks = []
    with open(path, "wb") as out:
        out.write(b"PAR1")
        for leaf in (leaf for _, leaves in parts for leaf in leaves):
            begin = out.tell()
            size = len(leaf.data)
            _, head = _thrift({1: 0, 2: size, 3: size, 5: {1: leaf.count, 2: _PLAIN, 3: _RLE, 4: _RLE}})
            out.write(head + leaf.data)
            total = _I64(out.tell() - begin)
            chunks.append({2: _I64(begin), 3: {1: leaf.kind, 2: [_PLAIN, _RLE], 3: leaf.path, 4: 0,
                                               5: _I64(leaf.count), 6: total, 7: total, 9: _I64(begin)}})
        group = {1: chunks, 2: _I64(sum(chunk[3][6] for chunk in chunks)), 3: _I64(rows)}
        footer = {1: 1, 2: schema, 3: _I64(rows), 4: [group], 6: "trocar"}
        if metadata:
            footer[5] = [{1: key, 2: text} for key, text in metadata.items()]
        _, data = _thrift(footer)
        out.write(data + struct.pack("<I", len(data)) + b"PAR1")
