"""The results of a study read without gathering, and the recipe for Kubernetes against its published schema.

usage: studies.py rows STUDY GATHERED | studies.py kubernetes FILE
"""

import sys
from pathlib import Path


def rows(study, gathered):
    """polars and DuckDB read the shards where they are: the rows of the gathered table."""
    import duckdb
    import polars

    wanted = polars.read_parquet(gathered)
    shards = f"{study}/shards/**/*.parquet"
    assert len(list(Path(study).glob("shards/**/*.parquet"))) > 2
    found = polars.scan_parquet(shards).sort("index").unique(subset="index", maintain_order=True).collect()
    assert found.equals(wanted), (found, wanted)
    by_sql = duckdb.sql(f"SELECT DISTINCT ON (index) * FROM '{shards}' ORDER BY index").fetchall()
    assert by_sql == wanted.rows(), by_sql[:3]
    least = polars.scan_parquet(shards).select(polars.col("index").n_unique()).collect().item()
    assert least == duckdb.sql(f"SELECT count(DISTINCT index) FROM '{shards}'").fetchall()[0][0] == wanted.height
    print("rows", wanted.height)


def kubernetes(path):
    """A Job that the API's schema takes, and one with a wrong word that it does not."""
    import kubernetes_validate
    import yaml

    job = yaml.safe_load(Path(path).read_text(encoding="utf-8"))
    for version in ["1.30", kubernetes_validate.latest_version()]:
        kubernetes_validate.validate(job, version, strict=True)
    spec = job["spec"]
    command = spec["template"]["spec"]["containers"][0]["command"]
    assert spec["completionMode"] == "Indexed" and command[command.index("--of") + 1] == str(spec["completions"])
    try:
        kubernetes_validate.validate({**job, "spec": {**spec, "completion": 3}}, version, strict=True)
    except kubernetes_validate.ValidationError:
        print("kubernetes", version)
    else:
        sys.exit("the schema takes anything")


if __name__ == "__main__":
    {"rows": rows, "kubernetes": kubernetes}[sys.argv[1]](*sys.argv[2:])
