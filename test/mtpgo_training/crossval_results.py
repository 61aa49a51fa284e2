# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Made-up results of a cross-validation."""

VALUES = {
    "fde": 2.0,
    "min_fde": 1.0,
    "mr": 0.1,
    "coverage_90": 0.9,
    "heaviest_nearest": 0.25,
    "chance": 0.125,
    "brier": 0.875,
    "jump": 1.25,
    "brier_min_fde": 1.5,
    "sigma_to_rmse_at": {"1": 1.0, "3": 0.9, "5": 0.8},
}


def group(ade, *, n=100, cv=2.0, five=0.8, nll=1.0):
    """The scores of a group of agents."""
    return VALUES | {
        "n": n,
        "ade": ade,
        "min_ade": ade / 2.0,
        "anll": nll,
        "ade_cv": cv,
        "ade_ca": cv,
        "ratio_cv": ade / cv,
        "ratio_ca": ade / cv,
        "coverage_90_at": {"1": 0.9, "3": 0.85, "5": five},
    }


def content(sites, tracker="recorded", folds=None):
    """The content of a cross-validation: groups by site; each site is a fold by default."""
    training = {"epochs": 12, "epochs_done": 11, "share": 0.5, "minutes": 6.0}
    return {
        "trackers": [tracker],
        "folds": [
            {
                "fold": fold,
                "training": training | {"validation_ade_m": 0.5},
                "sites": {
                    site: {"recordings": ["a/01"], "scores": {tracker: sites[site]}}
                    for site in left_out
                },
            }
            for fold, left_out in (folds or {site: [site] for site in sites}).items()
        ],
    }
