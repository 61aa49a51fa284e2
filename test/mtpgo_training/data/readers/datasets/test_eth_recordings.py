# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""ETH and UCY in their forms, made up: eight columns or four, any step of frames."""

import gzip

import numpy as np
import pytest

from mtpgo_core.errors import RecordingError
from mtpgo_core.schema import AgentClass
from mtpgo_training.data.readers import load_recordings


def test_obsmat_and_text_of_four_columns(tmp_path):
    (tmp_path / "seq_eth").mkdir()
    obsmat = "".join(
        f"  {frame:.7e}   {track:.7e}   {x:.7e}   0.0   {2 * x:.7e}   1.5   0   -0.5\n"
        for frame, track, x in ((780, 1, 8.5), (786, 1, 9.0), (786, 2, 3.0), (798, 2, 4.0))
    )
    (tmp_path / "seq_eth" / "obsmat.txt").write_text(obsmat)
    (tmp_path / "seq_eth" / "groups.txt").write_text("1 2 3 4\n")
    (tmp_path / "seq_eth" / "H.txt").write_text("1 0 0\n0 1 0\n0 0 1\n")
    (tmp_path / "zara01.txt").write_text("0.0\t1.0\t5.0\t6.0\n10.0\t1.0\t5.4\t6.0\n")
    eth, zara = load_recordings(tmp_path, "eth_ucy")
    assert (eth.name, zara.name) == ("seq_eth", "zara01")
    assert (eth.frame_rate, zara.frame_rate) == (2.5, 2.5)
    assert (eth.frame.tolist(), eth.track_id.tolist()) == ([0, 1, 1, 3], [1, 2])
    np.testing.assert_allclose(eth.position, [[8.5, 17], [9, 18], [3, 6], [4, 8]])
    np.testing.assert_allclose(eth.velocity, [[1.5, -0.5]] * 4)
    np.testing.assert_allclose(zara.position, [[5, 6], [5.4, 6]])
    assert np.isnan(zara.velocity).all()
    assert zara.agent_class.tolist() == [AgentClass.PEDESTRIAN]


@pytest.mark.parametrize("mark", [" ", "\t", ",", "  "])
def test_separators(tmp_path, mark):
    (tmp_path / "a.txt").write_text(f"0{mark}1{mark}5{mark}6\n10{mark}1{mark}5.4{mark}6\n")
    (recording,) = load_recordings(tmp_path / "a.txt", "eth_ucy")
    assert (recording.name, recording.frame.tolist()) == ("a", [0, 1])


def test_defects(tmp_path):
    (tmp_path / "a.txt").write_text("frame id x y\n")
    with pytest.raises(RecordingError, match=r"has no recordings, expected ETH's obsmat\.txt"):
        load_recordings(tmp_path, "eth_ucy")
    (tmp_path / "a.txt").write_text("0 1 5 6\n10 1 5.4 ?\n")
    with pytest.raises(RecordingError, match=r"a\.txt, line 2, column 'y': '\?', expected a numb"):
        load_recordings(tmp_path, "eth_ucy")


def test_positions_in_the_image_are_not_taken_for_metres(tmp_path):
    (tmp_path / "obsmat.txt").write_text("780 1 8.5 0 3 1 0 0\n")
    for name in ("obsmat_px.txt", "obsmat_px1.txt", "zara_pixels.txt"):
        (tmp_path / name).write_text("780 1 320 0 240 1 0 0\n")
    (recording,) = load_recordings(tmp_path, "eth_ucy")
    np.testing.assert_allclose(recording.position, [[8.5, 3.0]])


def test_files_of_one_name_are_told_apart_by_their_folders(tmp_path):
    for part in ("train", "val"):
        (tmp_path / "eth" / part).mkdir(parents=True)
        (tmp_path / "eth" / part / "HOTEL.TXT").write_text("0 1 5 6\n10 1 5.4 6\n")
    (tmp_path / "eth" / "train" / "zara.txt.gz").write_bytes(gzip.compress(b"0 1 5 6\n"))
    names = [recording.name for recording in load_recordings(tmp_path, "eth_ucy")]
    assert names == ["eth-train-HOTEL", "eth-val-HOTEL", "eth-zara"]


def test_pedestrians_that_were_annotated_in_other_frames_keep_their_pace(tmp_path):
    rows = [(10 * k + 5 * (i == 2), i, 0.5 * k, i) for i in (1, 2, 3) for k in range(9)]
    (tmp_path / "a.txt").write_text("".join("\t".join(map(str, row)) + "\n" for row in rows))
    (recording,) = load_recordings(tmp_path, "eth_ucy")
    assert recording.frame_rate == 5.0
    for track in range(3):
        of_it = recording.track == track
        seconds = recording.frame[of_it] / recording.frame_rate
        np.testing.assert_allclose(np.diff(seconds), 0.4)
    # A single frame that is annotated besides changes nothing either.
    extra = (tmp_path / "a.txt").read_text() + "33\t1\t1.6\t1\n"
    (tmp_path / "a.txt").write_text(extra)
    (recording,) = load_recordings(tmp_path, "eth_ucy")
    assert recording.frame_rate == 25.0
    assert recording.duration_s == pytest.approx(3.4)
