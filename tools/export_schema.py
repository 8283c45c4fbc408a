"""Write the JSON Schemas of specs to scene_specs/schema; a test keeps them in step with the models."""

from pathlib import Path

from dataset_builder.report.spec_help import write_schema

if __name__ == "__main__":
    write_schema(Path(__file__).resolve().parent.parent / "scene_specs" / "schema")
