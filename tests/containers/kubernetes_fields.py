"""JSON Schemas of the fields that our manifests use, no others.

Those of Ray are written from `ray-operator/apis/ray/v1` of KubeRay 1.4 (rayjob_types.go, raycluster_types.go), those of
Kubernetes from the reference of batch/v1 and core/v1 at version 1.33.
"""

from typing import Any

Schema = dict[str, Any]
TEXT, COUNT = {"type": "string", "minLength": 1}, {"type": "integer", "minimum": 0}
NAME = {"type": "string", "pattern": "^[a-z0-9]([-a-z0-9]*[a-z0-9])?$", "maxLength": 63}
QUANTITY = {"type": "string", "pattern": "^[0-9]+(m|[KMGT]i?)?$"}


def fields(required: Schema, **optional: Any) -> Schema:
    """An object that has all of the first, and none but these."""
    return {"type": "object", "properties": required | optional, "required": sorted(required),
            "additionalProperties": False}


def several(item: Schema) -> Schema:
    return {"type": "array", "items": item, "minItems": 1}


METADATA = fields({"name": NAME})
QUANTITIES = {"type": "object", "additionalProperties": QUANTITY,
              "propertyNames": {"enum": ["cpu", "memory", "storage", "nvidia.com/gpu"]}}
TOLERATION = fields({"key": TEXT, "operator": {"enum": ["Equal", "Exists"]}}, value=TEXT,
                    effect={"enum": ["NoSchedule", "PreferNoSchedule", "NoExecute"]})
CONTAINER = fields({"name": NAME, "image": TEXT}, command=several(TEXT),
                   resources=fields({}, requests=QUANTITIES, limits=QUANTITIES),
                   volumeMounts=several(fields({"name": NAME, "mountPath": {"type": "string", "pattern": "^/"}})))
VOLUME = fields({"name": NAME, "persistentVolumeClaim": fields({"claimName": NAME})})
SECURITY = fields({}, runAsUser=COUNT, runAsGroup=COUNT, fsGroup=COUNT)
POD = fields({"containers": several(CONTAINER)}, volumes=several(VOLUME), tolerations=several(TOLERATION),
             securityContext=SECURITY, restartPolicy={"enum": ["Never", "OnFailure"]})
TEMPLATE = fields({"spec": POD})
START = {"type": "object", "additionalProperties": {"type": "string"}}

HEAD = fields({"rayStartParams": START, "template": TEMPLATE})
WORKERS = fields({"groupName": NAME, "minReplicas": COUNT, "maxReplicas": COUNT, "rayStartParams": START,
                  "template": TEMPLATE}, replicas=COUNT)
CLUSTER = fields({"headGroupSpec": HEAD}, rayVersion=TEXT, workerGroupSpecs=several(WORKERS))
RULE = {"oneOf": [
    fields({"action": {"enum": ["FailJob", "FailIndex", "Ignore", "Count"]},
            "onExitCodes": fields({"operator": {"enum": ["In", "NotIn"]}, "values": several({"type": "integer"})},
                                  containerName=NAME)}),
    fields({"action": {"enum": ["FailJob", "FailIndex", "Ignore", "Count"]},
            "onPodConditions": several(fields({"type": TEXT, "status": {"enum": ["True", "False", "Unknown"]}}))})]}
JOB = fields({"template": TEMPLATE}, completionMode={"enum": ["Indexed", "NonIndexed"]}, completions=COUNT,
             parallelism=COUNT, backoffLimit=COUNT, backoffLimitPerIndex=COUNT,
             podFailurePolicy=fields({"rules": several(RULE)}))
CLAIM = fields({"accessModes": several({"enum": ["ReadWriteOnce", "ReadWriteMany", "ReadOnlyMany"]}),
                "resources": fields({"requests": QUANTITIES})})
RAY_JOB = fields({"entrypoint": TEXT, "rayClusterSpec": CLUSTER}, shutdownAfterJobFinishes={"type": "boolean"},
                 ttlSecondsAfterFinished=COUNT, backoffLimit=COUNT)

SPECS = {("ray.io/v1", "RayJob"): RAY_JOB, ("batch/v1", "Job"): JOB, ("v1", "PersistentVolumeClaim"): CLAIM}
"""By `apiVersion` and `kind`."""


def schema(version: str, kind: str) -> Schema:
    """Of a whole manifest. Raises KeyError where we have none of the kind."""
    return fields({"apiVersion": {"const": version}, "kind": {"const": kind}, "metadata": METADATA,
                   "spec": SPECS[version, kind]})
