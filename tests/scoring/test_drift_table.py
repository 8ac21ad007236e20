"""What is decoded of drift: as the study wrote it, but no less than the mean tells."""

from pipeline.results import one_table


def test_a_read_out_that_tells_less_than_nothing_tells_nothing(tmp_path):
    path = tmp_path / "drift.csv"
    rows = [
        ("task_1", '"raw voltages, 10 samples"', "true drift", 0.8),
        ("task_1", "latent of model-0", "true drift", 0.6),
        ("task_2", '"raw voltages, 10 samples"', "true drift", -0.03),
        ("task_2", "latent of model-0", "true drift", -0.07),
        ("task_2", "latent of direct training", "true drift", -0.08),
    ]
    lines = [f"{task},{seen},{target},0,r2,1,{value}" for task, seen, target, value in rows]
    path.write_text("\n".join(["protocol,input,target,seed,metric,unit,value", *lines]) + "\n")
    table = one_table.TABLES["drift"](path)
    found = table.set_index(["condition", "model", "metric"])["value"].to_dict()
    assert found == {
        ("task_1", "raw", "true_drift"): 0.8,
        ("task_1", "states", "true_drift"): 0.6,
        ("task_2", "raw", "true_drift"): 0.0,
        ("task_2", "states", "true_drift"): 0.0,
    }
