"""Commands of the reproduction, which a checkout has and an installed wheel has not."""

GROUPS = {  # heading of the help -> command -> its module in this room
    "The evidence on the papers": {
        "evidence": "evidence",
        "track": "track",
        "simulate": "simulate",
    },
    "Maintain the models": {
        "add": "add",
        "cards": "cards",
    },
}
