# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Definitions of the message packages that are part of neither rclpy's wheels nor rosbags.

Registered in a rosbags typestore, they let the offline half write and read bags of packages that
are not installed (the definition is embedded in the bag, so every reader knows it)::

    types = {}
    for name, text in DEFINITIONS.items():
        types.update(get_types_from_msg(text, name))
    typestore.register(types)

Fields, their order and their types are those of the packages named below; bytes on the wire
depend on nothing else. Constants are included so that a reader of a bag can name the numbers.
"""

from __future__ import annotations

# autoware_perception_msgs 1.x (Jazzy release).
_AUTOWARE = {
    "ObjectClassification": """
uint8 UNKNOWN=0
uint8 CAR=1
uint8 TRUCK=2
uint8 BUS=3
uint8 TRAILER=4
uint8 MOTORCYCLE=5
uint8 BICYCLE=6
uint8 PEDESTRIAN=7
uint8 ANIMAL=8
uint8 HAZARD=9
uint8 OVER_DRIVABLE=10
uint8 UNDER_DRIVABLE=11
uint8 label
float32 probability
""",
    "Shape": """
uint8 BOUNDING_BOX=0
uint8 CYLINDER=1
uint8 POLYGON=2
uint8 type
geometry_msgs/Polygon footprint
geometry_msgs/Vector3 dimensions
""",
    "TrackedObjectKinematics": """
uint8 UNAVAILABLE=0
uint8 SIGN_UNKNOWN=1
uint8 AVAILABLE=2
geometry_msgs/PoseWithCovariance pose_with_covariance
geometry_msgs/TwistWithCovariance twist_with_covariance
geometry_msgs/AccelWithCovariance acceleration_with_covariance
uint8 orientation_availability
bool is_stationary
""",
    "TrackedObject": """
unique_identifier_msgs/UUID object_id
float32 existence_probability
ObjectClassification[] classification
TrackedObjectKinematics kinematics
Shape shape
""",
    "TrackedObjects": """
std_msgs/Header header
TrackedObject[] objects
""",
    "PredictedPath": """
geometry_msgs/Pose[] path
builtin_interfaces/Duration time_step
float32 confidence
""",
    "PredictedObjectKinematics": """
geometry_msgs/PoseWithCovariance initial_pose_with_covariance
geometry_msgs/TwistWithCovariance initial_twist_with_covariance
geometry_msgs/AccelWithCovariance initial_acceleration_with_covariance
PredictedPath[] predicted_paths
""",
    "PredictedObject": """
unique_identifier_msgs/UUID object_id
float32 existence_probability
ObjectClassification[] classification
PredictedObjectKinematics kinematics
Shape shape
""",
    "PredictedObjects": """
std_msgs/Header header
PredictedObject[] objects
""",
}

# autoware_auto_perception_msgs (as Autoware used it until 2024): the same names, another order.
_AUTOWARE_AUTO = {
    "ObjectClassification": _AUTOWARE["ObjectClassification"],
    "Shape": _AUTOWARE["Shape"],
    "TrackedObjectKinematics": """
uint8 UNAVAILABLE=0
uint8 SIGN_UNKNOWN=1
uint8 AVAILABLE=2
geometry_msgs/PoseWithCovariance pose_with_covariance
uint8 orientation_availability
geometry_msgs/TwistWithCovariance twist_with_covariance
geometry_msgs/AccelWithCovariance acceleration_with_covariance
bool is_stationary
""",
    "TrackedObject": _AUTOWARE["TrackedObject"],
    "TrackedObjects": _AUTOWARE["TrackedObjects"],
}

# autoware_planning_msgs 1.x (Jazzy release).
_AUTOWARE_PLANNING = {
    "TrajectoryPoint": """
builtin_interfaces/Duration time_from_start
geometry_msgs/Pose pose
float32 longitudinal_velocity_mps
float32 lateral_velocity_mps
float32 acceleration_mps2
float32 heading_rate_rps
float32 front_wheel_angle_rad
float32 rear_wheel_angle_rad
""",
    "Trajectory": """
std_msgs/Header header
TrajectoryPoint[] points
""",
}

# vision_msgs 4.x.
_VISION = {
    "ObjectHypothesis": """
string class_id
float64 score
""",
    "ObjectHypothesisWithPose": """
ObjectHypothesis hypothesis
geometry_msgs/PoseWithCovariance pose
""",
    "BoundingBox3D": """
geometry_msgs/Pose center
geometry_msgs/Vector3 size
""",
    "Detection3D": """
std_msgs/Header header
ObjectHypothesisWithPose[] results
BoundingBox3D bbox
string id
""",
    "Detection3DArray": """
std_msgs/Header header
Detection3D[] detections
""",
}

# vision_msgs 2.x, of ROS 2 Foxy.
_EARLIER_VISION = {
    "ObjectHypothesisWithPose": """
string id
float64 score
geometry_msgs/PoseWithCovariance pose
""",
    "BoundingBox3D": _VISION["BoundingBox3D"],
    "Detection3D": """
std_msgs/Header header
ObjectHypothesisWithPose[] results
BoundingBox3D bbox
sensor_msgs/PointCloud2 source_cloud
bool is_tracking
string tracking_id
""",
    "Detection3DArray": _VISION["Detection3DArray"],
}

# derived_object_msgs 4.x.
_DERIVED = {
    "Object": """
std_msgs/Header header
uint32 id
uint8 detection_level
uint8 OBJECT_DETECTED=0
uint8 OBJECT_TRACKED=1
bool object_classified
geometry_msgs/Pose pose
geometry_msgs/Twist twist
geometry_msgs/Accel accel
geometry_msgs/Polygon polygon
shape_msgs/SolidPrimitive shape
uint8 classification
uint8 CLASSIFICATION_UNKNOWN=0
uint8 CLASSIFICATION_UNKNOWN_SMALL=1
uint8 CLASSIFICATION_UNKNOWN_MEDIUM=2
uint8 CLASSIFICATION_UNKNOWN_BIG=3
uint8 CLASSIFICATION_PEDESTRIAN=4
uint8 CLASSIFICATION_BIKE=5
uint8 CLASSIFICATION_CAR=6
uint8 CLASSIFICATION_TRUCK=7
uint8 CLASSIFICATION_MOTORCYCLE=8
uint8 CLASSIFICATION_OTHER_VEHICLE=9
uint8 CLASSIFICATION_BARRIER=10
uint8 CLASSIFICATION_SIGN=11
uint8 classification_certainty
uint32 classification_age
""",
    "ObjectArray": """
std_msgs/Header header
Object[] objects
""",
}

# perception_msgs of the ika perception_interfaces.
_IKA = {
    "ObjectClassification": """
uint8 UNCLASSIFIED=0
uint8 PEDESTRIAN=1
uint8 BICYCLE=2
uint8 MOTORBIKE=3
uint8 CAR=4
uint8 TRUCK=5
uint8 VAN=6
uint8 BUS=7
uint8 ANIMAL=8
uint8 ROAD_OBSTACLE=9
uint8 TRAIN=10
uint8 TRAILER=11
uint8 CAR_UNION=50
uint8 TRUCK_UNION=51
uint8 BIKE_UNION=52
uint8 UNKNOWN=100
uint8 type
float64 probability
""",
    "ObjectReferencePoint": """
uint8 GEOMETRIC_CENTER=0
uint8 BACK=1
uint8 BACK_LEFT=2
uint8 LEFT=3
uint8 FRONT_LEFT=4
uint8 FRONT=5
uint8 FRONT_RIGHT=6
uint8 RIGHT=7
uint8 BACK_RIGHT=8
uint8 GRAVITY_CENTER=10
uint8 REAR_AXLE_GROUND=11
uint8 UNKNOWN=100
uint8 UNKNOWN_EDGE=101
uint8 UNKNOWN_CORNER=102
uint8 value
geometry_msgs/Vector3 translation_to_geometric_center
""",
    "ObjectState": """
std_msgs/Header header
uint8 model_id
uint64[] sensor_id
float64[] continuous_state
int64[] discrete_state
float64[] continuous_state_covariance
ObjectClassification[] classifications
ObjectReferencePoint reference_point
""",
    "ObjectStatePrediction": """
float64 probability
ObjectState[] states
""",
    "Object": """
uint64 id
float64 existence_probability
ObjectState state
ObjectState[] state_history
ObjectStatePrediction[] state_predictions
""",
    "ObjectList": """
std_msgs/Header header
Object[] objects
""",
}

DEFINITIONS: dict[str, str] = {
    f"{package}/msg/{name}": text.lstrip("\n")
    for package, messages in (
        ("autoware_perception_msgs", _AUTOWARE),
        ("autoware_auto_perception_msgs", _AUTOWARE_AUTO),
        ("autoware_planning_msgs", _AUTOWARE_PLANNING),
        ("vision_msgs", _VISION),
        ("derived_object_msgs", _DERIVED),
        ("perception_msgs", _IKA),
    )
    for name, text in messages.items()
}
"""Definition text by type name, inner types before those that hold them."""

EARLIER_DEFINITIONS: dict[str, str] = {
    f"vision_msgs/msg/{name}": text.lstrip("\n") for name, text in _EARLIER_VISION.items()
}
"""Definition text of types that had other fields in ROS 2 Foxy, whose bags hold no definitions."""
