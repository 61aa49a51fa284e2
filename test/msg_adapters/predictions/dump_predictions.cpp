// Copyright 2026 the mtpgo_ros developers
// SPDX-License-Identifier: Apache-2.0
//
// Decodes serialised clouds with the C++ header and prints all numbers, for the comparison with
// the Python decoder: a line "file", then "error ..." or the content. Arguments: the files.

#include <cstdio>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "mtpgo_ros/predictions.hpp"
#ifdef WITH_MESSAGES
#include "mtpgo_ros/predictions_msg.hpp"
#endif

namespace
{

void print_state(const char * name, const mtpgo_ros::State & s)
{
  std::printf(
    "%s %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g\n", name, s.x, s.y, s.vx, s.vy, s.yaw,
    s.cov_xx, s.cov_xy, s.cov_yy);
}

void print(const mtpgo_ros::Predictions & found)
{
  std::printf("stamp %lld\n", static_cast<long long>(found.stamp_ns));
  std::printf("frame %s\n", found.frame_id.c_str());
  std::printf("shape %zu %zu %zu\n", found.agents.size(), found.modes, found.steps());
  for (const double t : found.time_s) {
    std::printf("time %.17g\n", t);
  }
  const auto moved = found.in_frame({100.0, -20.0, 2.5}, "other");
  for (std::size_t a = 0; a < found.agents.size(); ++a) {
    const auto & agent = found.agents[a];
    std::printf(
      "agent %u %u %u %u %u %u %u %.17g %.17g %.17g %zu %zu\n", agent.key[0], agent.key[1], agent.key[2],
      agent.key[3], agent.agent_class, agent.source, agent.calibration, agent.z,
      agent.length, agent.width, found.most_probable_mode(a), found.find(agent.key).value());
    for (std::size_t h = 0; h < found.steps(); ++h) {
      std::printf("factor %.17g\n", found.sigma_factor_50(a, h));
    }
    for (std::size_t m = 0; m < found.modes; ++m) {
      std::printf("weight %.17g\n", found.weight(a, m));
      for (std::size_t h = 0; h < found.steps(); ++h) {
        print_state("state", found.state(a, m, h));
        print_state("moved", moved.state(a, m, h));
      }
      for (const double t : {-0.1, 0.0, 0.1, 0.2, 0.33, 0.5, 1.0, 1.1}) {
        print_state("at", found.state_at(a, m, t).value_or(mtpgo_ros::State()));
      }
    }
    for (const double t : {0.1, 0.33, 1.0, 1.1}) {
      print_state("mixture", found.mixture_at(a, t).value_or(mtpgo_ros::State()));
    }
  }
}

mtpgo_ros::Predictions decoded(const std::vector<std::uint8_t> & data)
{
#ifdef WITH_MESSAGES
  const mtpgo_ros::Cloud cloud = mtpgo_ros::cloud_from_cdr(data.data(), data.size());
  sensor_msgs::msg::PointCloud2 message;
  message.header.stamp.sec = cloud.sec;
  message.header.stamp.nanosec = cloud.nanosec;
  message.header.frame_id = cloud.frame_id;
  message.height = cloud.height;
  message.width = cloud.width;
  for (const auto & field : cloud.fields) {
    sensor_msgs::msg::PointField copy;
    copy.name = field.name;
    copy.offset = field.offset;
    copy.datatype = field.datatype;
    copy.count = field.count;
    message.fields.push_back(copy);
  }
  message.is_bigendian = cloud.is_bigendian;
  message.point_step = cloud.point_step;
  message.row_step = cloud.row_step;
  message.data.assign(cloud.data, cloud.data + cloud.size);
  return mtpgo_ros::decode(message);
#else
  return mtpgo_ros::decode_cdr(data.data(), data.size());
#endif
}

}  // namespace

int main(int count, char ** names)
{
  for (int i = 1; i < count; ++i) {
    std::printf("file %s\n", names[i]);
    std::ifstream file(names[i], std::ios::binary);
    // A copy of exactly this size, so that a sanitizer sees every byte read behind its end.
    const std::vector<std::uint8_t> data{
      std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
    try {
      print(decoded(data));
    } catch (const mtpgo_ros::DecodeError & error) {
      std::printf("error %s\n", error.what());
    }
  }
  return 0;
}
