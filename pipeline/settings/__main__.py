"""Print the JSON schema of params.yaml: `python -m pipeline.settings > params.schema.json`."""

import json

from pipeline.settings import Params

if __name__ == "__main__":
    print(json.dumps(Params.model_json_schema(), indent=1))
