"""fill_page.py PORT OBSERVERS_CODE INSTRUCTORS_CODE: fills a page that takes 20 connections."""

import base64
import json
import os
import socket
import struct
import sys

PORT = int(sys.argv[1])
WELCOME, GOODBYE = 17, 22  # numbers in Envelope
MASK = b"\0\0\0\0"


def read_exactly(connection, count):
    data = b""
    while len(data) < count:
        more = connection.recv(count - len(data))
        if not more:
            raise ConnectionError("closed")
        data += more
    return data


def first_message(connection):
    """Returns the number in Envelope, and the bytes, of the first message."""
    length = read_exactly(connection, 2)[1] & 0x7F
    if length == 126:
        length = struct.unpack(">H", read_exactly(connection, 2))[0]
    data = read_exactly(connection, length)
    return (data[0] & 0x7F | data[1] << 7) >> 3, data


def join(name, role, code):
    """Returns the connection and what it was told first; None: it was closed without a word."""
    connection = socket.create_connection(("127.0.0.1", PORT), timeout=20)
    key = base64.b64encode(os.urandom(16)).decode()
    connection.sendall(
        f"GET /session HTTP/1.1\r\nHost: 127.0.0.1:{PORT}\r\nOrigin: http://127.0.0.1:{PORT}\r\n"
        "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        f"Sec-WebSocket-Key: {key}\r\n\r\n".encode())
    try:
        head = b""
        while not head.endswith(b"\r\n\r\n"):
            head += read_exactly(connection, 1)
        text = json.dumps({"name": name, "role": role, "code": code}).encode()
        # It is short enough for a length of one byte, and a mask of zeros changes nothing.
        connection.sendall(bytes([0x81, 0x80 | len(text)]) + MASK + text)
        return connection, first_message(connection)
    except ConnectionError:
        return connection, None


def expect(condition, what):
    if not condition:
        sys.exit(f"places: {what}")


def main():
    observers = [join(f"Observer {i}", "observer", sys.argv[2]) for i in range(18)]
    expect(all(told and told[0] == WELCOME for _, told in observers), "an observer has no place")
    for i in range(3):
        connection, told = join(f"Late {i}", "observer", sys.argv[2])
        connection.close()
        expect(told and told[0] == GOODBYE and b"places" in told[1],
               f"an observer too many is not told so, but {told}")
    instructors = [join(f"Instructor {i}", "instructor", sys.argv[3]) for i in range(2)]
    expect(all(told and told[0] == WELCOME for _, told in instructors),
           "an instructor does not get in while observers fill the page")


main()
