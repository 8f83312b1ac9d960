#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""check_schema.py SCHEMA JOB...: says of each job (JSON) whether the schema accepts it: one
line "ok" or "refused: where" per job."""
import json
import sys

import jsonschema


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        schema = json.load(file)
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    for name in sys.argv[2:]:
        with open(name, encoding="utf-8") as file:
            job = json.load(file)
        errors = sorted(validator.iter_errors(job), key=lambda error: list(map(str, error.path)))
        if not errors:
            print("ok")
            continue
        print("refused: " + "; ".join("/".join(map(str, error.path)) for error in errors))


main()
