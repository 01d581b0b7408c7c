"""What is told of the model-predictive controller is what the commands wrote."""

from __future__ import annotations

from mute.command_lines.card_mpc import mpc_figures

RELIABILITY = {
    "robots": 7,
    "machine": "a machine",
    "figures": [
        {
            "part": "starts",
            "name": "go, beta 0",
            "value": 0.5,
            "unit": "share",
            "target": ">= 98 %",
        },
        {
            "part": "starts",
            "name": "go, beta 1",
            "value": 0.25,
            "unit": "share",
            "target": ">= 98 %",
        },
        {"part": "falls", "name": "fall", "value": 0.125, "unit": "share", "target": "< 1.0 %"},
    ],
}
NOISE = [
    {"surface": "wood", "beta": 0.0, "trials": 5, "mnl_mean": 70.25, "mnl_ci95": 0.31,
     "pnl_mean": 75.0, "pnl_ci95": 1.0, "speed_mean": 0.487, "landing_speed_mean": 0.7,
     "fall_rate": 0.0},
]  # fmt: skip
SPEED = {
    "machine": "another",
    "walks": [
        {"robots": 64, "control step, median (ms)": 12.34, "control step, 95 % (ms)": 15.0,
         "times real time, with physics": 1.234},
    ],
}  # fmt: skip


def test_every_figure_is_there_but_for_those_of_other_betas():
    lines = mpc_figures(RELIABILITY, NOISE, SPEED).splitlines()
    assert "| starts | go, beta 0 | 50.0 % | >= 98 % |" in lines
    assert "| falls | fall | 12.5 % | < 1.0 % |" in lines
    assert not any("beta 1" in line for line in lines)
    assert "| wood | 70.2 ± 0.3 | 79.7 | 75.0 ± 1.0 | 84.0 | 0.49 | 0.70 | 0% |" in lines
    assert "| 64 | 12.3 | 15.0 | 1.23 |" in lines
    assert any("--robots 7 --parts starts,falls --out docs/mpc`" in line for line in lines)
    assert any("--trials 5 --out docs/mpc`" in line for line in lines)
