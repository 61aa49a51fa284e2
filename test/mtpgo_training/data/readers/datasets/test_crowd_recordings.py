# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""DUT and CITR in their own columns, made up: image axes, numbers that overlap."""

import numpy as np
import pytest

from mtpgo_core.errors import RecordingError
from mtpgo_core.schema import AgentClass
from mtpgo_training.data.readers import load_recordings

PEDESTRIANS = "id,frame,label,x_est,y_est,vx_est,vy_est\n0,5,ped,1,10,1.5,-0.5\n0,6,ped,2,11,1,1\n"
VEHICLES = "id,frame,label,x_est,y_est,psi_est,vel_est\n0,5,veh,20,30,1.5707963267948966,4\n"


@pytest.mark.parametrize(("layout", "rate"), [("dut", 23.976), ("citr", 29.970)])
def test_pedestrians_and_vehicles(tmp_path, layout, rate):
    folder = tmp_path / "data" / "trajectories_filtered"
    folder.mkdir(parents=True)
    (folder / "intersection_01_traj_ped_filtered.csv").write_text(PEDESTRIANS)
    (folder / "intersection_01_traj_veh_filtered.csv").write_text(VEHICLES)
    (folder / "roundabout_02_traj_ped_filtered.csv").write_text(PEDESTRIANS)
    (folder / "roundabout_02_ratio_pixel2meter.txt").write_text("30\n")
    both, alone = load_recordings(tmp_path, layout)
    assert [r.name for r in (both, alone)] == ["intersection_01", "roundabout_02"]
    assert (both.location, both.frame.tolist()) == ("intersection", [5, 5, 6])
    assert both.frame_rate == pytest.approx(rate, abs=1e-3)
    assert both.agent_class.tolist() == [AgentClass.PEDESTRIAN, AgentClass.CAR]
    # Down in the image is to the right of x.
    np.testing.assert_allclose(both.position, [[1, -10], [20, -30], [2, -11]])
    np.testing.assert_allclose(both.velocity, [[1.5, 0.5], [0, -4], [1, -1]], atol=1e-12)
    np.testing.assert_allclose(both.yaw, [np.nan, -np.pi / 2, np.nan])
    assert np.isnan(both.size).all()
    assert alone.agent_class.tolist() == [AgentClass.PEDESTRIAN]


def test_defects(tmp_path):
    with pytest.raises(RecordingError, match="has no recordings, expected files such as 01_traj"):
        load_recordings(tmp_path, "dut")
    (tmp_path / "a_traj_ped_filtered.csv").write_text(PEDESTRIANS + "0,6,ped,2,11,1,1\n")
    with pytest.raises(RecordingError, match="line 4: track p0 has a second row for frame 6"):
        load_recordings(tmp_path, "citr")


@pytest.mark.parametrize(
    ("kind", "head"),
    [
        ("ped", ",id,x,y,frame,label,x_est,y_est,vx_est,vy_est\n0,0,528,113,"),
        ("veh", ",id,x_c,y_c,frame,label,x_est,y_est,vx_est,vy_est\n0,0,528,113,"),
    ],
)
def test_the_first_edition_in_pixels_is_refused(tmp_path, kind, head):
    path = tmp_path / f"roundabout_03_traj_{kind}_filtered.csv"
    path.write_text(f"{head}1,{kind},528,113,14,80\n")
    sentence = (
        r"first edition, whose positions are pixels \(it has the column 'x(_c)?'\), expected"
    )
    with pytest.raises(RecordingError, match=sentence):
        load_recordings(tmp_path, "dut")
