# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Tiny recordings with hand-worked numbers, written as the data sets write them."""

from __future__ import annotations

import gzip
from pathlib import Path

HIGHD_TRACKS = """\
frame,id,x,y,width,height,xVelocity,yVelocity,xAcceleration,yAcceleration,frontSightDistance,\
backSightDistance,dhw,thw,ttc,precedingXVelocity,precedingId,followingId,leftPrecedingId,\
leftAlongsideId,leftFollowingId,rightPrecedingId,rightAlongsideId,rightFollowingId,laneId
1,1,100.0,8.0,5.0,2.0,-30.0,0.0,0.5,0.25,97.0,318.0,0,0,0,0,0,0,0,0,0,0,0,0,2
2,1,98.8,8.0,5.0,2.0,-30.0,3.0,0.5,0.25,97.0,318.0,0,0,0,0,0,0,0,0,0,0,0,0,2
1,2,200.0,26.0,10.0,2.5,20.0,-2.0,0.0,0.0,210.0,205.0,0,0,0,0,0,0,0,0,0,0,0,0,6
2,2,200.8,25.92,10.0,2.5,20.0,-2.0,0.0,0.0,210.0,205.0,0,0,0,0,0,0,0,0,0,0,0,0,6
2,3,50.0,9.0,4.0,1.5,0.0,0.0,0.0,0.0,50.0,370.0,0,0,0,0,0,0,0,0,0,0,0,0,2
"""

HIGHD_TRACKS_META = """\
id,width,height,initialFrame,finalFrame,numFrames,class,drivingDirection,traveledDistance,\
minXVelocity,maxXVelocity,meanXVelocity,minDHW,minTHW,minTTC,numLaneChanges
1,5.0,2.0,1,2,2,Car,1,1.2,30,30,30,-1,-1,-1,0
2,10.0,2.5,1,2,2,Truck,2,0.8,20,20,20,-1,-1,-1,0
3,4.0,1.5,2,2,1,Car,1,0.0,0,0,0,-1,-1,-1,0
"""

HIGHD_RECORDING_META = """\
id,frameRate,locationId,speedLimit,month,weekDay,startTime,duration,totalDrivenDistance,\
totalDrivenTime,numVehicles,numCars,numTrucks,upperLaneMarkings,lowerLaneMarkings
1,25,2,-1,9.2017,Tue,08:38,0.08,2.0,0.2,3,2,1,8.5;12.6;16.4,21.0;25.1;28.9
"""

IND_TRACKS = """\
recordingId,trackId,frame,trackLifetime,xCenter,yCenter,heading,width,length,xVelocity,yVelocity,\
xAcceleration,yAcceleration,lonVelocity,latVelocity,lonAcceleration,latAcceleration
7,0,0,0,10.0,-20.0,270.0,2.0,4.5,0.0,-8.0,0.0,1.0,8.0,0.0,-1.0,0.0
7,0,1,1,10.0,-20.8,270.0,2.0,4.5,0.0,-8.0,0.0,1.0,8.0,0.0,-1.0,0.0
7,0,3,3,10.0,-22.4,180.0,2.0,4.5,0.0,-8.0,0.0,1.0,8.0,0.0,-1.0,0.0
7,5,1,0,30.0,-5.0,45.0,0.0,0.0,1.0,1.0,,,1.4142,0.0,0.0,0.0
"""

IND_TRACKS_META = """\
recordingId,trackId,initialFrame,finalFrame,numFrames,width,length,class
7,0,0,3,3,2.0,4.5,truck_bus
7,5,1,1,1,0.0,0.0,pedestrian
"""

IND_RECORDING_META = """\
recordingId,locationId,frameRate,speedLimit,weekday,startTime,duration,numTracks,numVehicles,\
numVRUs,latLocation,lonLocation,xUtmOrigin,yUtmOrigin,orthoPxToMeter
7,4,10,13.9,monday,9,0.3,2,1,1,50.8,6.1,300000.0,5620000.0,0.0127
"""


def write_recording(
    directory: Path, name: str, tracks: str, tracks_meta: str, recording_meta: str
) -> Path:
    """The three files of one recording."""
    directory.mkdir(parents=True, exist_ok=True)
    for kind, text in (
        ("tracks", tracks),
        ("tracksMeta", tracks_meta),
        ("recordingMeta", recording_meta),
    ):
        (directory / f"{name}_{kind}.csv").write_text(text)
    return directory


def write_highd(directory: Path, name: str = "01") -> Path:
    return write_recording(directory, name, HIGHD_TRACKS, HIGHD_TRACKS_META, HIGHD_RECORDING_META)


def write_ind(directory: Path, name: str = "07") -> Path:
    return write_recording(directory, name, IND_TRACKS, IND_TRACKS_META, IND_RECORDING_META)


def pack(path: Path) -> None:
    """Replace ``path`` by ``path.gz``."""
    with gzip.open(f"{path}.gz", "wt") as stream:
        stream.write(path.read_text())
    path.unlink()
