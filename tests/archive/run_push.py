"""run_push.py JOURNAL ROOT OUT: recordings are brought to storage that checks every signature and checksum."""

import hashlib
import os
import shutil
import struct
import subprocess
import sys

from fake_s3 import KEY_ID, REGION, SECRET, TOKEN, Storage

JOURNAL, ROOT, OUT = sys.argv[1:4]
PART = 5 << 20
keys = {"AWS_ACCESS_KEY_ID": KEY_ID, "AWS_SECRET_ACCESS_KEY": SECRET, "AWS_SESSION_TOKEN": TOKEN, "AWS_REGION": REGION}
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
    digest = hashlib.sha256(small_bytes).hexdigest()
    expect(digest in said and storage.objects["2026/May/session.mcap"][1] == digest, f"its checksum: {said}")
    code, said = push(small, "s3://lessons/2026/May", *at)
    expect(code == 0 and "is there" in said, f"again: {code} {said}")

    # A large one in three parts, interrupted after two.
    large = f"{OUT}/recordings/large.mcap"
    large_bytes = write_recording(large, 2 * PART + 70_000)
    storage.fails_after = 3  # the mark and two parts
    code, said = push(large, "s3://lessons", *at, "--part-mb", "5")
    expect(code != 0 and "SlowDown" in said and len(said.splitlines()) == 1, f"interrupted: {code} {said}")
    expect("large.mcap" not in storage.objects, "half of it is there")
    storage.fails_after = -1
    code, said = push(large, "s3://lessons", *at, "--part-mb", "5")
    expect(code == 0 and storage.objects["large.mcap"][0] == large_bytes, f"gone on: {code} {said}")
    expect("3 parts, 2 of them were there" in said, f"parts are sent twice: {said}")
    expect(not storage.uploads, "an upload is left")

    # An interrupted upload of another file is given up: its checksum is not this file's.
    other = f"{OUT}/recordings/other.mcap"
    write_recording(other, 2 * PART + 10_000)
    with open(other, "r+b") as file:
        file.seek(PART + 1000)
        file.write(b"another file")
    storage.fails_after = 3  # the mark and two parts
    code, said = push(other, "s3://lessons", *at, "--part-mb", "5")
    expect(code != 0 and len(storage.uploads) == 1, f"other interrupted: {code} {said}")
    storage.fails_after = -1
    other_bytes = write_recording(other, 2 * PART + 10_000)
    code, said = push(other, "s3://lessons", *at, "--part-mb", "5")
    expect(code == 0 and storage.objects.get("other.mcap") == (other_bytes, hashlib.sha256(other_bytes).hexdigest()),
           f"another file's upload: {code} {said}")
    expect(not storage.uploads, "the other file's upload is left")

    # So is one that shares every part that is there, and differs in one that is not; and so is one
    # that nothing marks as this file's.
    def take_mark_away():
        for _, _, parts in storage.uploads.values():
            del parts[1000]

    for name, tail, take_away in (("shared", 50_000, lambda: None), ("unmarked", 10_000, take_mark_away)):
        storage.objects.pop("other.mcap")
        write_recording(other, 2 * PART + tail)
        with open(other, "r+b") as file:  # the records' lengths are those of the file that follows
            file.write(other_bytes[:2 * PART])
        storage.fails_after = 3
        code, said = push(other, "s3://lessons", *at, "--part-mb", "5")
        expect(code != 0 and len(storage.uploads) == 1, f"{name} interrupted: {code} {said}")
        take_away()
        storage.fails_after = -1
        other_bytes = write_recording(other, 2 * PART + 10_000)
        code, said = push(other, "s3://lessons", *at, "--part-mb", "5")
        expect(code == 0 and storage.objects.get("other.mcap") == (other_bytes, hashlib.sha256(other_bytes).hexdigest()),
               f"an upload that is {name}: {code} {said}")
        expect(not storage.uploads, f"the upload that is {name} is left")
    os.remove(other)

    # What another program brings while it is sent stays, in one part and in several.
    for size in (1000, 2 * PART):
        write_recording(other, size)
        storage.objects.pop("other.mcap", None)
        storage.brings = {"other.mcap": b"theirs"}
        code, said = push(other, "s3://lessons", *at, "--part-mb", "5")
        expect(code == 4 and "other content" in said and storage.objects["other.mcap"][0] == b"theirs",
               f"brought meanwhile: {code} {said}")
        expect(not storage.uploads, "an upload is left")
    os.remove(other)

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
            ((small, "s3://L/x", *at), None, "a bucket has 3 to 63", 2),
            ((small, "s3://lessons", "--endpoint", "http://storage.example"), None, "without TLS", 2),
            ((small, "s3://lessons", "--endpoint", "http://127.anything.example"), None, "without TLS", 2),
            ((small, "s3://lessons", "--endpoint", "ftp://127.0.0.1"), None, "not of the form https://", 2),
            ((small, "s3://lessons", "--endpoint", f"{storage.endpoint}/path"), None, "not of the form", 2),
            ((small, "s3://lessons", *at), {}, "AWS_ACCESS_KEY_ID: is not set", 2),
            ((small, "s3://lessons", *at, "--part-mb", "4"), None, "--part-mb", 2),
            ((f"{OUT}/none.mcap", "s3://lessons", *at), None, "none.mcap", None)):
        code, said = push(*arguments, environment=environment)
        expect(code == expected if expected else code != 0, f"{words}: {code}")
        expect(words in said and len(said.splitlines()) == 1, f"{words}: {said}")
    expect(len(storage.requests) == count, f"asked for: {storage.requests[count:]}")
    code, said = push(small, "s3://lessons/new", *at, environment={**keys, "AWS_SECRET_ACCESS_KEY": "another"})
    expect(code == 4 and "403" in said and "another" not in said, f"wrong key: {code} {said}")
    expect(all(words in said for words in ("AWS_SECRET_ACCESS_KEY", f"region {REGION}", "bucket lessons")) and
           len(said.splitlines()) == 1, f"nothing to do: {said}")
    code, said = push(small, "s3://other-bucket", *at)
    expect(code != 0, f"no bucket: {code} {said}")
    code, said = push(small, "s3://lessons", "--endpoint", "http://127.0.0.1:1")
    expect(code == 5 and len(said.splitlines()) == 1, f"no storage: {code} {said}")


main()
for line in faults:
    print(f"push: {line}")
sys.exit(1 if faults else 0)
