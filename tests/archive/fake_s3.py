"""Storage that speaks as much of Amazon's S3 interface as a push needs, and takes no request whose signature
(AWS Signature Version 4, docs.aws.amazon.com) is not right; of addresses that are signed as a whole it looks at the keys."""

import hashlib
import hmac
import http.server
import re
import threading
import urllib.parse

KEY_ID, SECRET, TOKEN, REGION = "AKIDEXAMPLE", "wJalrXUtnFEMI/K7MDENG+bPxRfiCYEXAMPLEKEY", "a/session+token==" + "T" * 2000, "eu-west-7"


def signature_of(handler, body):
    """The signature that the request should have."""
    said = dict(part.strip().split("=", 1) for part in
                handler.headers["Authorization"].split(" ", 1)[1].split(","))
    date = handler.headers["x-amz-date"]
    scope = f"{date[:8]}/{REGION}/s3/aws4_request"
    assert said["Credential"] == f"{KEY_ID}/{scope}", said
    signed = said["SignedHeaders"].split(";")
    must = {"host", "x-amz-date", "x-amz-content-sha256"} | {
        name.lower() for name in handler.headers if name.lower().startswith("x-amz-")}
    assert must <= set(signed), f"not signed: {must - set(signed)}"
    path, _, query = handler.path.partition("?")
    pairs = sorted(tuple((part.split("=", 1) + [""])[:2]) for part in query.split("&") if part)
    payload = handler.headers["x-amz-content-sha256"]
    assert payload in ("UNSIGNED-PAYLOAD", hashlib.sha256(body).hexdigest()), "the body is another one"
    canonical = "\n".join([handler.command, path, "&".join(f"{name}={value}" for name, value in pairs),
                           *(f"{name}:{' '.join(handler.headers[name].split())}" for name in signed), "",
                           ";".join(signed), payload])
    text = "\n".join(["AWS4-HMAC-SHA256", date, scope, hashlib.sha256(canonical.encode()).hexdigest()])
    key = f"AWS4{SECRET}".encode()
    for word in (date[:8], REGION, "s3", "aws4_request"):
        key = hmac.new(key, word.encode(), hashlib.sha256).digest()
    return hmac.new(key, text.encode(), hashlib.sha256).hexdigest(), said["Signature"]


class Storage:
    def __init__(self):
        self.objects = {}      # key: (bytes, checksum)
        self.uploads = {}      # id: (key, checksum, {number: bytes})
        self.fails_after = -1  # parts, then it answers 503
        self.requests = []     # method, path and query
        self.refused = []
        storage = self

        class Handler(http.server.BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def answer(self, status, body=b"", **headers):
                self.send_response(status)
                for name, value in headers.items():
                    self.send_header(name.replace("_", "-"), value)
                if "Content_Length" not in headers:
                    self.send_header("Content-Length", str(len(body)))
                self.end_headers()
                self.wfile.write(body)

            def serve(self):
                body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
                storage.requests.append(f"{self.command} {self.path}")
                try:
                    if "Authorization" in self.headers:
                        right, said = signature_of(self, body)
                        assert right == said, "the signature is wrong"
                        assert self.headers["x-amz-security-token"] == TOKEN, "no token"
                    else:
                        signed = dict(urllib.parse.parse_qsl(self.path.partition("?")[2]))
                        assert signed["X-Amz-Credential"].startswith(f"{KEY_ID}/"), "another key"
                        assert signed["X-Amz-Security-Token"] == TOKEN, "no token"
                except (AssertionError, KeyError, TypeError) as error:
                    storage.refused.append(f"{self.command} {self.path}: {error}")
                    return self.answer(403, b"<Error><Code>SignatureDoesNotMatch</Code>"
                                            b"<Message>It does not match.</Message></Error>")
                path, _, query = self.path.partition("?")
                words = dict(urllib.parse.parse_qsl(query, keep_blank_values=True))
                key = urllib.parse.unquote(path).removeprefix("/lessons").removeprefix("/")
                return self.act(key, words, body)

            do_GET = do_HEAD = do_PUT = do_POST = do_DELETE = serve

            def act(self, key, words, body):
                checksum = self.headers.get("x-amz-meta-md5chksum", "")
                if not urllib.parse.unquote(self.path).startswith("/lessons"):
                    return self.answer(404, b"<Error><Code>NoSuchBucket</Code><Message>There is none.</Message></Error>")
                if self.command == "HEAD":
                    if key not in storage.objects:
                        return self.answer(404)
                    content, checksum = storage.objects[key]
                    return self.answer(200, Content_Length=str(len(content)), x_amz_meta_md5chksum=checksum,
                                       ETag=f'"{hashlib.md5(content).hexdigest()}"', Last_Modified="Thu, 01 Jan 2026 08:00:00 GMT")
                if self.command == "DELETE":
                    storage.uploads.pop(words["uploadId"], None)
                    return self.answer(204)
                if self.command == "PUT" and "uploadId" not in words:
                    storage.objects[key] = (body, checksum)
                    return self.answer(200, ETag=f'"{hashlib.md5(body).hexdigest()}"')
                if self.command == "PUT":
                    parts = storage.uploads[words["uploadId"]][2]
                    if len(parts) == storage.fails_after:
                        return self.answer(503, b"<Error><Code>SlowDown</Code><Message>Later.</Message></Error>")
                    parts[int(words["partNumber"])] = body
                    return self.answer(200, ETag=f'"{hashlib.md5(body).hexdigest()}"')
                if "uploads" in words:
                    name = f"id/{len(storage.requests)}+="
                    storage.uploads[name] = (key, checksum, {})
                    return self.answer(200, f"<InitiateMultipartUploadResult><UploadId>{name}</UploadId></InitiateMultipartUploadResult>".encode())
                of, checksum, parts = storage.uploads.pop(words["uploadId"])
                # An object is of the parts that are named, in order; the others go.
                text = body.decode().replace("&#34;", "").replace("&quot;", "").replace('"', "")
                named = list(zip(map(int, re.findall(r"<PartNumber>(\d+)<", text)), re.findall(r"<ETag>(\w+)<", text)))
                if of != key or not named or named != sorted(named) or any(
                        number not in parts or hashlib.md5(parts[number]).hexdigest() != tag for number, tag in named):
                    return self.answer(200, b"<Error><Code>InvalidPart</Code><Message>Not these.</Message></Error>")
                if any(len(parts[number]) < 5 << 20 for number, _ in named[:-1]):
                    return self.answer(400, b"<Error><Code>EntityTooSmall</Code><Message>Too small.</Message></Error>")
                storage.objects[key] = (b"".join(parts[number] for number, _ in named), checksum)
                return self.answer(200, b"<CompleteMultipartUploadResult/>")

            def log_message(self, *_):
                pass

        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        threading.Thread(target=self.server.serve_forever, daemon=True).start()
        self.endpoint = f"http://127.0.0.1:{self.server.server_port}"
