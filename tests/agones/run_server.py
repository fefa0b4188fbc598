"""run_server.py SERVER JOURNAL OUT: a real server and a sidecar that speaks Agones' published interface.

It has to be told, in this order: ready, allocate when somebody joins, shutdown when the recording is whole; and
health all the time. A wrong port is refused in one line.
"""

import http.server
import os
import shutil
import subprocess
import sys
import threading

SERVER, JOURNAL, OUT = sys.argv[1:4]
CLIENT = os.path.join(os.path.dirname(SERVER), "trocar-client")
RECORDING = f"{OUT}/session.mcap"
told, was_whole, had_summary = [], [], []


class Sidecar(http.server.BaseHTTPRequestHandler):
    def answer(self, body):
        self.send_response(200)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def do_POST(self):
        assert self.rfile.read(int(self.headers["Content-Length"])) == b"{}"
        if self.path == "/shutdown":
            was_whole.append(subprocess.run([JOURNAL, "verify", RECORDING], capture_output=True, check=False).returncode)
            had_summary.append(os.path.exists(f"{OUT}/summary.json"))
        told.append(self.path)
        self.answer(b"{}")

    def do_GET(self):
        told.append(self.path)
        self.answer(b'{"object_meta": {"name": "trocar-1"}, "status": {"address": "10.0.0.7", "ports": [{"port": 7412}]}}')

    def log_message(self, *_):
        pass


def fail(text):
    print(f"agones: {text}")
    sys.exit(1)


def main():
    shutil.rmtree(OUT, ignore_errors=True)
    os.makedirs(f"{OUT}/run", mode=0o700)
    sidecar = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Sidecar)
    threading.Thread(target=sidecar.serve_forever, daemon=True).start()
    environment = {**os.environ, "XDG_STATE_HOME": f"{OUT}/state", "XDG_RUNTIME_DIR": f"{OUT}/run",
                   "AGONES_SDK_HTTP_PORT": str(sidecar.server_port)}
    command = [SERVER, "--agones", "--organ", "lattice", "--listen", "127.0.0.1:0", "--insecure-loopback",
               "--ready-file", f"{OUT}/ready", "--journal", RECORDING, "--seconds", "6",
               "--summary", f"{OUT}/summary.json"]
    with subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True) as server:
        while not os.path.exists(f"{OUT}/ready") and server.poll() is None:
            pass
        if os.path.exists(CLIENT):
            with open(f"{OUT}/ready", encoding="ascii") as file:
                port = file.read().strip()
            subprocess.run([CLIENT, "--server", f"127.0.0.1:{port}", "--insecure-loopback", "--no-render", "--name", "Ada",
                            "--role", "surgeon", "--seconds", "3"], env=environment, capture_output=True, check=False)
        said = server.stderr.read()
    if server.returncode != 0:
        fail(f"the server ended with {server.returncode}: {said}")
    once = [path for path in told if path != "/health"]
    allocated = ["/allocate"] if os.path.exists(CLIENT) else []
    if once != ["/ready", "/gameserver", *allocated, "/shutdown"]:
        fail(f"it was told {once}")
    if told.count("/health") < 3 or told[-1] != "/shutdown":
        fail(f"it was told {told}")
    if was_whole != [0]:
        fail(f"the recording was not whole at the end: {was_whole}")
    if had_summary != [True]:
        fail("the figures of the run were not written at the end")
    if "ready as trocar-1, reached at 10.0.0.7:7412" not in said:
        fail(f"the log does not say where it is reached: {said}")
    environment["AGONES_SDK_HTTP_PORT"] = "http"
    refused = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if refused.returncode != 2 or "AGONES_SDK_HTTP_PORT: http is not a port" not in refused.stderr:
        fail(f"a wrong port: {refused.returncode}, {refused.stderr}")


main()
