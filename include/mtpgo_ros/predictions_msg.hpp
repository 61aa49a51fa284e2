// Copyright 2026 the mtpgo_ros developers
// SPDX-License-Identifier: Apache-2.0
//
// The decoder of predictions for nodes: decode() of a sensor_msgs::msg::PointCloud2.

#ifndef MTPGO_ROS__PREDICTIONS_MSG_HPP_
#define MTPGO_ROS__PREDICTIONS_MSG_HPP_

#include <sensor_msgs/msg/point_cloud2.hpp>

#include "mtpgo_ros/predictions.hpp"

namespace mtpgo_ros
{

/// The predictions in a message of the topic ~/predictions; nothing of it is referred to.
///
/// \throws DecodeError see decode(const Cloud &)
inline Predictions decode(const sensor_msgs::msg::PointCloud2 & message)
{
  Cloud cloud;
  cloud.sec = message.header.stamp.sec;
  cloud.nanosec = message.header.stamp.nanosec;
  cloud.frame_id = message.header.frame_id;
  cloud.height = message.height;
  cloud.width = message.width;
  for (const auto & field : message.fields) {
    cloud.fields.push_back({field.name, field.offset, field.datatype, field.count});
  }
  cloud.is_bigendian = message.is_bigendian;
  cloud.point_step = message.point_step;
  cloud.row_step = message.row_step;
  cloud.data = message.data.data();
  cloud.size = message.data.size();
  return decode(cloud);
}

}  // namespace mtpgo_ros

#endif  // MTPGO_ROS__PREDICTIONS_MSG_HPP_
