"""run_push.py JOURNAL ROOT OUT: recordings are brought to storage that checks signatures, and to WebDAV, by rclone.

Exit code 77: rclone is missing."""

import hashlib
import os
import shutil
import socket
import struct
import subprocess
import sys
import time

from fake_s3 import KEY_ID, REGION, SECRET, TOKEN, Storage

JOURNAL, ROOT, OUT = sys.argv[1:4]
PART = 5 << 20
keys = {"RCLONE_CONFIG": f"{OUT}/none.conf", "RCLONE_S3_UPLOAD_CUTOFF": "5Mi", "AWS_ACCESS_KEY_ID": KEY_ID, "AWS_SECRET_ACCESS_KEY": SECRET, "AWS_SESSION_TOKEN": TOKEN, "AWS_REGION": REGION}
bare = {name: value for name, value in os.environ.items() if not name.startswith("AWS_") and "proxy" not in name.lower()}
faults = []


def expect(is_true, text):
    if not is_true:
        faults.append(text)


def push(*arguments, environment=None):
    done = subprocess.run([JOURNAL, "push", *arguments], capture_output=True, text=True, check=False,
                          env={**bare, **(keys if environment is None else environment)})
    return done.returncode, done.stdout + done.stderr


def write_recording(path, size):
    """An MCAP file with a record that every reader skips, and a summary."""
    def record(code, content):
        return struct.pack("<BQ", code, len(content)) + content

    magic = bytes([0x89]) + b"MCAP0\r\n"
    data = magic + record(1, struct.pack("<I", 6) + b"trocar" + struct.pack("<I", 0))
    filler = b"".join(hashlib.sha256(struct.pack("<Q", i)).digest() for i in range(size // 32))
    data += record(0x80, filler) + record(0x0f, struct.pack("<I", 0))
    summary = len(data)
    data += record(0x0b, struct.pack("<QHIIIIQQI", 0, 0, 0, 0, 0, 0, 0, 0, 0)) + record(2, struct.pack("<QQI", summary, 0, 0))
    with open(path, "wb") as file:
        file.write(data + magic)
    return data + magic


def main():
    shutil.rmtree(OUT, ignore_errors=True)
    os.makedirs(f"{OUT}/recordings/20260101T080000Z-group a+1")
    storage = Storage()
    at = ["--endpoint", storage.endpoint]
    small = f"{OUT}/recordings/20260101T080000Z-group a+1/session.mcap"
    small_bytes = write_recording(small, 1000)
    code, said = push(small, "s3://lessons/2026/May/", *at)
    expect(code == 0 and storage.objects.get("2026/May/session.mcap", (b"",))[0] == small_bytes, f"small: {code} {said}")
    code, said = push(small, "s3://lessons/2026/May", *at)
    expect(code == 0 and "is there" in said, f"again: {code} {said}")

    # A large one in parts, interrupted after two: nothing of it is there until all is.
    large = f"{OUT}/recordings/large.mcap"
    large_bytes = write_recording(large, 2 * PART + 70_000)
    storage.fails_after = 2
    code, said = push(large, "s3://lessons", *at, "--part-mb", "5")
    expect(code == 5 and "is not sent" in said and len(said.splitlines()) == 1, f"interrupted: {code} {said}")
    expect("large.mcap" not in storage.objects, "half of it is there")
    storage.fails_after = -1
    code, said = push(large, "s3://lessons", *at, "--part-mb", "5")
    expect(code == 0 and storage.objects["large.mcap"][0] == large_bytes, f"sent after all: {code} {said}")
    code, said = push(large, "s3://lessons", *at, "--part-mb", "5")
    expect(code == 0 and "is there" in said, f"parts again: {code} {said}")
    expect(not storage.uploads, "an upload is left")

    # Something else of that name stays as it is.
    write_recording(large, 2000)
    code, said = push(large, "s3://lessons", *at)
    expect(code == 4 and "other content" in said and storage.objects["large.mcap"][0] == large_bytes, f"replaced: {code} {said}")
    os.remove(large)

    # A folder: keys are the paths below it; what has no end is named, and the rest is sent.
    torn = f"{OUT}/recordings/torn.mcap"
    with open(torn, "wb") as file:
        file.write(small_bytes[:500])
    write_recording(f"{OUT}/recordings/whole.mcap", 3000)
    with open(f"{OUT}/recordings/server.log", "w", encoding="utf-8") as file:
        file.write("join codes\n")
    code, said = push(f"{OUT}/recordings", "s3://lessons/all", *at)
    expect(code == 3 and "torn.mcap: is still being written" in said, f"folder: {code} {said}")
    expect({key for key in storage.objects if key.startswith("all/")} ==
           {"all/20260101T080000Z-group a+1/session.mcap", "all/whole.mcap"}, f"keys: {list(storage.objects)}")
    expect(not storage.refused, f"refused: {storage.refused[:3]}")

    # What is refused, before anything is sent or by the storage.
    count = len(storage.requests)
    for arguments, environment, words, expected in (
            ((small, "lessons/x", *at), None, "is not of the form s3://", 2),
            ((small, "s3://lessons"), None, "--endpoint", 2),
            ((small, "s3://L/x", *at), None, "a bucket has 3 to 63", 2),
            ((small, "s3://lessons", "--endpoint", "http://storage.example"), None, "without TLS", 2),
            ((small, "s3://lessons", "--endpoint", "http://127.anything.example"), None, "without TLS", 2),
            ((small, "s3://lessons", "--endpoint", "ftp://127.0.0.1"), None, "' is not of the form https", 2),
            ((small, "s3://lessons", "--endpoint", f"{storage.endpoint}/path"), None, "' is not of the form https", 2),
            ((small, "s3://lessons", *at), {}, "AWS_ACCESS_KEY_ID: is not set", 2),
            ((small, "s3://lessons", *at, "--part-mb", "4"), None, "--part-mb", 2),
            ((f"{OUT}/none.mcap", "s3://lessons", *at), None, "none.mcap", None)):
        code, said = push(*arguments, environment=environment)
        expect(code == expected if expected else code != 0, f"{words}: {code}")
        expect(words in said and len(said.splitlines()) == 1, f"{words}: {said}")
    expect(len(storage.requests) == count, f"asked for: {storage.requests[count:]}")
    code, said = push(small, "s3://lessons/new", *at, environment={**keys, "AWS_SECRET_ACCESS_KEY": "another"})
    expect(code == 4 and "403" in said and "another" not in said, f"wrong key: {code} {said}")
    expect("--region" in said and len(said.splitlines()) == 1, f"nothing to do: {said}")
    code, said = push(small, "s3://other-bucket", *at)
    expect(code != 0, f"no bucket: {code} {said}")
    code, said = push(small, "s3://lessons", "--endpoint", "http://127.0.0.1:1")
    expect(code == 5 and len(said.splitlines()) == 1, f"no storage: {code} {said}")

    code, said = push(small, "s3://lessons", *at, environment={**keys, "PATH": "/nonexistent"})
    expect(code == 5 and "install the package rclone" in said and len(said.splitlines()) == 1, f"no rclone: {code} {said}")

    # Any other storage of rclone's: here its own server for WebDAV, in a second process.
    os.makedirs(f"{OUT}/dav")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    server = subprocess.Popen(["rclone", "serve", "webdav", f"{OUT}/dav", "--addr", f"127.0.0.1:{port}"],
                              stderr=subprocess.DEVNULL)
    try:
        while socket.socket().connect_ex(("127.0.0.1", port)) and server.poll() is None:
            time.sleep(0.05)
        dav = f":webdav,url='http://127.0.0.1:{port}':lessons"
        for words in (": sent", ": is there"):
            code, said = push(small, dav)
            expect(code == 0 and words in said, f"WebDAV: {code} {said}")
        # A link is brought as what it names; a name that rclone cannot be told is never called there.
        linked, odd = f"{OUT}/linked.mcap", f"{OUT}/odd\nname.mcap"
        os.symlink(small, linked)
        shutil.copy(small, odd)
        code, said = push(linked, dav)
        expect(code == 0 and os.path.exists(f"{OUT}/dav/lessons/linked.mcap"), f"a link: {code} {said}")
        code, said = push(odd, dav)
        expect(code == 5 and "is not sent" in said, f"an odd name: {code} {said}")
        write_recording(small, 2000)
        code, said = push(small, dav)
        expect(code == 4 and "other content" in said, f"replaced by WebDAV: {code} {said}")
        there = f"{OUT}/dav/lessons/session.mcap"
        expect(os.path.exists(there) and open(there, "rb").read() == small_bytes, "WebDAV has something else")
    finally:
        server.terminate()
        server.wait()


if shutil.which("rclone") is None:
    print("push: rclone is missing: nothing was tried")
    sys.exit(77)
main()
for line in faults:
    print(f"push: {line}")
sys.exit(1 if faults else 0)
