"""Write params.schema.json, by which editors complete and explain the keys of params.yaml and params/*.yaml."""

from pathlib import Path

from pipeline.settings import schema

if __name__ == "__main__":
    Path("params.schema.json").write_text(schema() + "\n", encoding="utf-8")
