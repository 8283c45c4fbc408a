"""3DF-Lighting builder: scene and object specs in, sharded EXR tuples for lighting transfer out."""

__version__ = "0.1.0"
