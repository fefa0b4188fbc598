"""check_chart.py ROOT SERVER: the Helm chart of deploy/helm/trocar gives what Kubernetes and Agones take.

Templates are filled in as Helm does for what they use: {{ .Values.X }}, {{ .Release.Name }}, | quote. Then each
manifest is checked field by field against the parts of the published schemas that it uses: a field that is not
there, or of another type, is an error, as the servers of a cluster refuse it. Exit code 77: python3-yaml is missing.
"""

import json
import os
import re
import subprocess
import sys

try:
    import yaml
except ImportError:
    print("kubernetes: SKIPPED: python3-yaml is missing")
    sys.exit(77)

ROOT, SERVER = sys.argv[1:3]
CHART = f"{ROOT}/deploy/helm/trocar"
NAME = "lessons"
faults = []

# Types of fields; a dict is an object with these fields and no others, "*" stands for any name, a one-element list
# for a list. A "!" before a name: it has to be there.
LABELS = {"*": str}
META = {"!name": str, "labels": LABELS}
RESOURCES = {"requests": {"cpu": str, "memory": str}, "limits": {"memory": str}}
CONTAINER = {"!name": str, "!image": str, "args": [str], "ports": [{"name": str, "!containerPort": int, "protocol": str}],
             "resources": RESOURCES, "volumeMounts": [{"!name": str, "!mountPath": str, "subPathExpr": str}],
             "env": [{"!name": str, "valueFrom": {"fieldRef": {"!fieldPath": str}}}],
             "securityContext": {"allowPrivilegeEscalation": bool, "capabilities": {"drop": [str]}}}
POD = {"!containers": [CONTAINER], "terminationGracePeriodSeconds": int, "securityContext": {"fsGroup": int},
       "volumes": [{"!name": str, "persistentVolumeClaim": {"!claimName": str}}]}
HEALTH = {"disabled": bool, "initialDelaySeconds": int, "periodSeconds": int, "failureThreshold": int}
# Source: agones.dev, "GameServer Specification" and "Fleet Specification" (agones.dev/v1).
GAME_SERVER = {"!ports": [{"!name": str, "!portPolicy": ["Dynamic", "Static", "Passthrough"], "!containerPort": int,
                           "protocol": ["UDP", "TCP", "TCPUDP"]}],
               "health": HEALTH, "!template": {"metadata": {"labels": LABELS}, "!spec": POD}}
FLEET = {"!apiVersion": str, "!kind": str, "!metadata": META,
         "!spec": {"!replicas": int, "scheduling": ["Packed", "Distributed"],
                   "!template": {"metadata": {"labels": LABELS}, "!spec": GAME_SERVER}}}
# Source: agones.dev, "FleetAutoscaler Specification" and "GameServerAllocation Specification".
AUTOSCALER = {"!apiVersion": ["autoscaling.agones.dev/v1"], "!kind": ["FleetAutoscaler"], "!metadata": META,
              "!spec": {"!fleetName": str,
                        "!policy": {"!type": ["Buffer"], "!buffer": {"!bufferSize": int, "!maxReplicas": int}}}}
ALLOCATION = {"!apiVersion": ["allocation.agones.dev/v1"], "!kind": ["GameServerAllocation"],
              "!spec": {"!selectors": [{"!matchLabels": LABELS}]}}
SERVICE = {"!apiVersion": str, "!kind": str, "!metadata": META,
           "!spec": {"clusterIP": str, "publishNotReadyAddresses": bool, "!selector": LABELS,
                     "!ports": [{"name": str, "!port": int, "targetPort": str, "protocol": str}]}}


def fault(text):
    faults.append(text)


def check(value, schema, where):
    if isinstance(schema, dict):
        if not isinstance(value, dict):
            return fault(f"{where}: is no object")
        known = {name.lstrip("!"): kind for name, kind in schema.items()}
        for name, entry in value.items():
            kind = known.get(name, known.get("*"))
            if kind is None:
                fault(f"{where}.{name}: there is no such field")
            else:
                check(entry, kind, f"{where}.{name}")
        for name in schema:
            if name.startswith("!") and name[1:] not in value:
                fault(f"{where}.{name[1:]}: is missing")
    elif isinstance(schema, list) and isinstance(schema[0], str):
        if value not in schema:
            fault(f"{where}: {value} is none of {', '.join(schema)}")
    elif isinstance(schema, list):
        if not isinstance(value, list) or not value:
            return fault(f"{where}: is no list with entries")
        for number, entry in enumerate(value):
            check(entry, schema[0], f"{where}[{number}]")
    elif type(value) is not schema:
        fault(f"{where}: {value!r} is no {schema.__name__}")


def fill_in(text, values, where):
    def value_of(found):
        words = [word.strip() for word in found.group(1).split("|")]
        if words[0] == ".Release.Name":
            value = NAME
        elif words[0].startswith(".Values.") and words[0][8:] in values:
            value = values[words[0][8:]]
        else:
            fault(f"{where}: {words[0]}: values.yaml has no such value")
            value = ""
        if words[1:] not in ([], ["quote"]):
            fault(f"{where}: {found.group(0)}: this test does not know it")
        return f'"{value}"' if words[1:] else str(value)

    return re.sub(r"\{\{-?\s*(.*?)\s*-?\}\}", value_of, text)


def read(path):
    with open(path, encoding="utf-8") as file:
        return file.read()


def check_notes(notes):
    """People paste its lines: each command has to be whole in one, and what it creates has to be taken."""
    created = re.findall(r"^ *echo '(.*)' \| kubectl create -f -$", notes, re.MULTILINE)
    if len(created) != 1 or "<<" in notes:
        return fault("NOTES.txt: has no command of one line that takes a session")
    allocation = json.loads(created[0])
    check(allocation, ALLOCATION, "NOTES.txt")
    if allocation["spec"]["selectors"] != [{"matchLabels": {"agones.dev/fleet": NAME}}]:
        fault("NOTES.txt: takes no session of this fleet")


def main():
    chart, values = yaml.safe_load(read(f"{CHART}/Chart.yaml")), yaml.safe_load(read(f"{CHART}/values.yaml"))
    check(chart, {"!apiVersion": ["v2"], "!name": str, "description": str, "type": ["application", "library"],
                  "!version": str, "kubeVersion": str}, "Chart.yaml")
    filled = {name: fill_in(read(f"{CHART}/templates/{name}"), values, name)
              for name in os.listdir(f"{CHART}/templates")}
    for value in values:
        if not any(f".Values.{value} " in read(f"{CHART}/templates/{name}") for name in filled):
            fault(f"values.yaml: {value}: no template has it")
    fleet, service, scaler = (yaml.safe_load(filled[name]) for name in ("fleet.yaml", "service.yaml", "autoscaler.yaml"))
    check(fleet, FLEET, "fleet")
    check(scaler, AUTOSCALER, "autoscaler")
    check_notes(filled["NOTES.txt"])
    check(service, SERVICE, "service")
    if faults:
        return
    game_server = fleet["spec"]["template"]["spec"]
    container = game_server["template"]["spec"]["containers"][0]
    if (fleet["apiVersion"], fleet["kind"]) != ("agones.dev/v1", "Fleet"):
        fault("fleet: is none")
    # What the manifests say of the server is so.
    image = read(f"{ROOT}/deploy/Containerfile")
    port = game_server["ports"][0]["containerPort"]
    if f"0.0.0.0:{port}" not in image:
        fault(f"fleet: the image does not listen at port {port}")
    help_text = subprocess.run([SERVER, "--help"], capture_output=True, text=True, check=True).stdout
    for word in container["args"]:
        if word.startswith("--") and word not in help_text:
            fault(f"fleet: trocar-server has no option {word}")
    metrics = container["args"][container["args"].index("--metrics") + 1]
    by_name = {entry["name"]: entry["containerPort"] for entry in container["ports"]}
    if metrics != f"0.0.0.0:{by_name['metrics']}" or service["spec"]["ports"][0]["targetPort"] != "metrics":
        fault("service: does not lead to the server's figures")
    labels = game_server["template"]["metadata"]["labels"]
    if any(labels.get(key) != value for key, value in service["spec"]["selector"].items()):
        fault("service: selects no pod of the fleet")
    # A pause between two pings that the cluster takes for death.
    health = game_server["health"]
    if health["periodSeconds"] < 2 * 2:
        fault("fleet: the server says every 2 s that it is well, which is too seldom for that period")
    mount, volume = container["volumeMounts"][0], game_server["template"]["spec"]["volumes"][0]
    if f"WORKDIR {mount['mountPath']}" not in image:
        fault(f"fleet: the image does not record in {mount['mountPath']}")
    # Recordings outlive the pod, each session's in a folder of its own.
    if mount["name"] != volume["name"] or "persistentVolumeClaim" not in volume:
        fault("fleet: recordings are lost with their pod")
    variables = {entry["name"]: entry["valueFrom"]["fieldRef"]["fieldPath"] for entry in container["env"]}
    if [variables.get(name) for name in re.findall(r"\$\((.*?)\)", mount["subPathExpr"])] != ["metadata.name"]:
        fault("fleet: sessions share one folder of recordings")
    if scaler["spec"]["fleetName"] != fleet["metadata"]["name"]:
        fault("autoscaler: it is of another fleet")
    if scaler["spec"]["policy"]["buffer"]["maxReplicas"] < scaler["spec"]["policy"]["buffer"]["bufferSize"]:
        fault("autoscaler: keeps more ready than there may be")


main()
for line in faults:
    print(f"kubernetes: {line}")
sys.exit(1 if faults else 0)
