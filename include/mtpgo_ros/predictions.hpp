// Copyright 2026 the mtpgo_ros developers
// SPDX-License-Identifier: Apache-2.0
//
// Decoder of the predictions that the node publishes as sensor_msgs/PointCloud2, in C++17.
//
// This header needs the standard library only: it reads the bytes of a serialised message
// (decode_cdr) or the fields of one (decode). mtpgo_ros/predictions_msg.hpp adds decode() for
// sensor_msgs::msg::PointCloud2. The layout is in docs/messages.md; the functions do what those of
// the Python module msg_adapters.predictions do, and the tests compare both on the same bytes.
//
// Lengths are in metres, times in seconds, angles in radians counter-clockwise from +x, covariances
// in square metres, all in the frame of the message's header.

#ifndef MTPGO_ROS__PREDICTIONS_HPP_
#define MTPGO_ROS__PREDICTIONS_HPP_

#if __cplusplus < 201703L && (!defined(_MSVC_LANG) || _MSVC_LANG < 201703L)
#error "mtpgo_ros/predictions.hpp needs C++17 or later: -std=c++17, CMAKE_CXX_STANDARD 17"
#endif

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace mtpgo_ros
{

/// A message that holds no predictions, is cut off, or contradicts itself.
class DecodeError : public std::runtime_error
{
public:
  using std::runtime_error::runtime_error;
};

/// 128-bit identity of an agent, least significant word first.
using Key = std::array<std::uint32_t, 4>;

/// Key of a tracker's number.
inline Key key_from_number(std::uint64_t number)
{
  return {static_cast<std::uint32_t>(number), static_cast<std::uint32_t>(number >> 32), 0, 0};
}

/// Key of the sixteen bytes of a UUID.
inline Key key_from_uuid(const std::array<std::uint8_t, 16> & bytes)
{
  Key key{};
  for (std::size_t i = 0; i < 16; ++i) {
    key[3 - i / 4] = key[3 - i / 4] << 8 | bytes[i];
  }
  return key;
}

/// Who made a prediction, see Agent::source.
enum Source : std::uint8_t
{
  SOURCE_MODEL = 0,
  SOURCE_CONSTANT_VELOCITY = 1,
  SOURCE_PREFERRED_CONSTANT_VELOCITY = 2,
};

/// What was applied to the model's prediction, see Agent::calibration.
enum Calibration : std::uint8_t
{
  CALIBRATION_NONE = 0,
  CALIBRATION_SHIPPED = 1,
  CALIBRATION_ONLINE = 2,
  CALIBRATION_ONLINE_PATH = 3,
};

/// A field of a point, as in sensor_msgs/PointField.
struct Field
{
  std::string name;
  std::uint32_t offset{0};
  std::uint8_t datatype{0};
  std::uint32_t count{1};
};

/// The content of a sensor_msgs/PointCloud2. The points are not copied: `data` must outlive it.
struct Cloud
{
  std::int32_t sec{0};
  std::uint32_t nanosec{0};
  std::string frame_id;
  std::uint32_t height{0};
  std::uint32_t width{0};
  std::vector<Field> fields;
  bool is_bigendian{false};
  std::uint32_t point_step{0};
  std::uint32_t row_step{0};
  const std::uint8_t * data{nullptr};
  std::size_t size{0};
};

/// Position, velocity, heading and covariance of the position; all NaN where not known.
struct State
{
  double x{std::numeric_limits<double>::quiet_NaN()};
  double y{std::numeric_limits<double>::quiet_NaN()};
  double vx{std::numeric_limits<double>::quiet_NaN()};
  double vy{std::numeric_limits<double>::quiet_NaN()};
  double yaw{std::numeric_limits<double>::quiet_NaN()};
  double cov_xx{std::numeric_limits<double>::quiet_NaN()};
  double cov_xy{std::numeric_limits<double>::quiet_NaN()};
  double cov_yy{std::numeric_limits<double>::quiet_NaN()};
};

/// What all points of an agent share.
struct Agent
{
  Key key{};
  std::uint8_t agent_class{0};  ///< class value of docs/messages.md
  std::uint8_t source{0};       ///< Source
  std::uint8_t calibration{0};  ///< Calibration
  double z{0.0};                ///< height at the stamp, 0 if unknown (m)
  /// Size (m); NaN if unknown or in a cloud from before it was published.
  double length{std::numeric_limits<double>::quiet_NaN()};
  double width{std::numeric_limits<double>::quiet_NaN()};
};

/// Planar pose of a frame in another one.
struct Pose
{
  double x{0.0};
  double y{0.0};
  double yaw{0.0};

  /// Pose of the other frame in this one.
  Pose inverse() const
  {
    const double c = std::cos(yaw);
    const double s = std::sin(yaw);
    return {-(c * x + s * y), s * x - c * y, -yaw};
  }
};

/// Angle wrapped to (-pi, pi].
inline double wrap(double angle)
{
  constexpr double pi = 3.141592653589793238462643383279502884;
  const double turned = std::fmod(pi - angle, 2.0 * pi);
  return pi - (turned < 0.0 ? turned + 2.0 * pi : turned);
}

/// Gaussian mixtures of n agents: `modes` modes at `time_s.size()` steps each.
class Predictions
{
public:
  std::int64_t stamp_ns{0};      ///< time of the observation (ns)
  std::string frame_id;          ///< frame of all vectors
  std::vector<Agent> agents;     ///< in the order of their first points
  std::size_t modes{0};          ///< of every agent; mode 0 is the most probable
  std::vector<double> time_s;    ///< of each step, after the stamp (s); NaN if it has no point
  std::vector<double> weights;   ///< [agent][mode], see weight()
  std::vector<State> states;     ///< [agent][mode][step], see state()
  std::vector<double> factors;   ///< [agent][step], see sigma_factor_50()

  std::size_t steps() const {return time_s.size();}

  /// Probability of a mode; they sum to 1 over the modes. 0 if the mode has no point.
  double weight(std::size_t agent, std::size_t mode) const
  {
    check(agent, mode, 0);
    return weights[agent * modes + mode];
  }

  /// State in a mode at a step; all NaN if the cloud has no such point.
  const State & state(std::size_t agent, std::size_t mode, std::size_t step) const
  {
    check(agent, mode, step);
    return states[(agent * modes + mode) * steps() + step];
  }

  /// Factor on the standard deviations for the 50 % ellipse.
  double sigma_factor_50(std::size_t agent, std::size_t step) const
  {
    check(agent, 0, step);
    return factors[agent * steps() + step];
  }

  /// Row of the agent with an identity, nothing if it is not predicted.
  std::optional<std::size_t> find(const Key & key) const
  {
    for (std::size_t agent = 0; agent < agents.size(); ++agent) {
      if (agents[agent].key == key) {
        return agent;
      }
    }
    return std::nullopt;
  }

  /// The most probable mode of an agent: 0, unless points were filtered out.
  std::size_t most_probable_mode(std::size_t agent) const
  {
    check(agent, 0, 0);
    const auto first = weights.begin() + static_cast<std::ptrdiff_t>(agent * modes);
    const auto last = first + static_cast<std::ptrdiff_t>(modes);
    return static_cast<std::size_t>(std::max_element(first, last) - first);
  }

  /// State in a mode at a time after the stamp (s), interpolated linearly between two steps, the
  /// yaw along the shorter arc. Before the first step that step is carried back by its velocity.
  /// Nothing before the stamp, after the last step, and where a point is missing.
  std::optional<State> state_at(std::size_t agent, std::size_t mode, double t) const
  {
    constexpr double slack = 1e-4;  // a time this close to a step is that step's (s)
    check(agent, mode, 0);
    const State * before = nullptr;
    double before_s = 0.0;
    if (!(t >= 0.0)) {
      return std::nullopt;
    }
    for (std::size_t step = 0; step < steps(); ++step) {
      const double after_s = time_s[step];
      if (std::isnan(after_s)) {
        continue;
      }
      const State & after = state(agent, mode, step);
      if (after_s >= t - slack) {
        const bool exact = std::abs(after_s - t) <= slack;
        State found = after;
        if (before == nullptr) {
          const double back_s = std::min(t - after_s, 0.0);
          found.x += back_s * after.vx;
          found.y += back_s * after.vy;
        } else if (!exact) {
          found = between(*before, after, (t - before_s) / (after_s - before_s));
        }
        if (std::isnan(found.x)) {
          return std::nullopt;
        }
        return found;
      }
      before = &after;
      before_s = after_s;
    }
    return std::nullopt;
  }

  /// Mean and covariance of the whole mixture of an agent at a time after the stamp (s): the yaw
  /// is NaN. One Gaussian cannot show two separate ways. Nothing where no mode has a state.
  std::optional<State> mixture_at(std::size_t agent, double t) const
  {
    std::vector<std::pair<double, State>> known;
    double total = 0.0;
    for (std::size_t mode = 0; mode < modes; ++mode) {
      const auto found = state_at(agent, mode, t);
      if (found && std::isfinite(found->x) && std::isfinite(found->cov_xx)) {
        known.emplace_back(weight(agent, mode), *found);
        total += known.back().first;
      }
    }
    if (!(total > 0.0)) {
      return std::nullopt;
    }
    State sum;
    sum.x = sum.y = sum.vx = sum.vy = sum.cov_xx = sum.cov_xy = sum.cov_yy = 0.0;
    for (const auto & [weight, one] : known) {
      sum.x += weight / total * one.x;
      sum.y += weight / total * one.y;
      sum.vx += weight / total * one.vx;
      sum.vy += weight / total * one.vy;
    }
    for (const auto & [weight, one] : known) {
      const double dx = one.x - sum.x;
      const double dy = one.y - sum.y;
      sum.cov_xx += weight / total * (one.cov_xx + dx * dx);
      sum.cov_xy += weight / total * (one.cov_xy + dx * dy);
      sum.cov_yy += weight / total * (one.cov_yy + dy * dy);
    }
    return sum;
  }

  /// The same predictions in another frame. Velocities stay over ground, heights are not changed.
  ///
  /// \param pose of the present frame in the other one, as lookupTransform(other, frame_id, time)
  /// \param other name of the other frame
  Predictions in_frame(const Pose & pose, const std::string & other) const
  {
    Predictions moved = *this;
    moved.frame_id = other;
    const double c = std::cos(pose.yaw);
    const double s = std::sin(pose.yaw);
    for (State & one : moved.states) {
      const State old = one;
      one.x = c * old.x - s * old.y + pose.x;
      one.y = s * old.x + c * old.y + pose.y;
      one.vx = c * old.vx - s * old.vy;
      one.vy = s * old.vx + c * old.vy;
      one.yaw = wrap(old.yaw + pose.yaw);
      one.cov_xx = c * c * old.cov_xx - 2.0 * c * s * old.cov_xy + s * s * old.cov_yy;
      one.cov_xy = c * s * (old.cov_xx - old.cov_yy) + (c * c - s * s) * old.cov_xy;
      one.cov_yy = s * s * old.cov_xx + 2.0 * c * s * old.cov_xy + c * c * old.cov_yy;
    }
    return moved;
  }

private:
  void check(std::size_t agent, std::size_t mode, std::size_t step) const
  {
    if (agent >= agents.size() || mode >= modes || step >= steps()) {
      throw std::out_of_range(
              "agent " + std::to_string(agent) + ", mode " + std::to_string(mode) + ", step " +
              std::to_string(step) + " of " + std::to_string(agents.size()) + " agents, " +
              std::to_string(modes) + " modes and " + std::to_string(steps()) + " steps");
    }
  }

  static State between(const State & a, const State & b, double share)
  {
    const auto mix = [share](double left, double right) {return left + share * (right - left);};
    State found;
    found.x = mix(a.x, b.x);
    found.y = mix(a.y, b.y);
    found.vx = mix(a.vx, b.vx);
    found.vy = mix(a.vy, b.vy);
    found.yaw = wrap(a.yaw + share * wrap(b.yaw - a.yaw));
    found.cov_xx = mix(a.cov_xx, b.cov_xx);
    found.cov_xy = mix(a.cov_xy, b.cov_xy);
    found.cov_yy = mix(a.cov_yy, b.cov_yy);
    return found;
  }
};

namespace detail
{

/// An unsigned integer of either byte order at an address.
template<typename Unsigned>
Unsigned load(const std::uint8_t * place, bool big_endian)
{
  Unsigned value = 0;
  for (std::size_t i = 0; i < sizeof(Unsigned); ++i) {
    const std::size_t shift = 8 * (big_endian ? sizeof(Unsigned) - 1 - i : i);
    value = static_cast<Unsigned>(value | static_cast<Unsigned>(place[i]) << shift);
  }
  return value;
}

/// Plain CDR (XCDR1) of either byte order; every value is aligned to its own size.
class CdrReader
{
public:
  CdrReader(const std::uint8_t * data, std::size_t size)
  : data_(data), size_(size)
  {
    if (data == nullptr || size < header_) {
      throw DecodeError(
              "point cloud has " + std::to_string(size) + " bytes, expected at least " +
              std::to_string(header_));
    }
    if (data[0] != 0 || data[1] > 1) {
      throw DecodeError(
              "point cloud has the encoding " + std::to_string(data[0] * 256 + data[1]) +
              ", expected plain CDR (0 or 1)");
    }
    big_endian_ = data[1] == 0;
  }

  std::uint8_t octet() {return *take(1);}

  std::uint32_t word()
  {
    const std::size_t excess = (place_ - header_) % 4;
    if (excess != 0) {
      take(4 - excess);
    }
    return load<std::uint32_t>(take(4), big_endian_);
  }

  std::string text()
  {
    const std::size_t length = word();
    const std::uint8_t * start = take(length);
    std::string found(start, start + length);
    while (!found.empty() && found.back() == '\0') {
      found.pop_back();
    }
    return found;
  }

  const std::uint8_t * take(std::size_t length)
  {
    if (length > size_ - place_) {
      throw DecodeError(
              "point cloud of " + std::to_string(size_) + " bytes is cut off: " +
              std::to_string(length) + " bytes were expected from byte " +
              std::to_string(place_) + " on");
    }
    const std::uint8_t * start = data_ + place_;
    place_ += length;
    return start;
  }

  std::size_t rest() const {return size_ - place_;}

private:
  static constexpr std::size_t header_ = 4;
  const std::uint8_t * data_;
  std::size_t size_;
  std::size_t place_{header_};
  bool big_endian_{false};
};

/// Where a value is in a point.
struct Column
{
  std::uint32_t offset{0};
  std::uint8_t datatype{0};
};

constexpr std::uint8_t UINT8 = 2;
constexpr std::uint8_t UINT32 = 6;
constexpr std::uint8_t FLOAT32 = 7;
constexpr std::uint8_t FLOAT64 = 8;

/// The columns of a point by name.
class Layout
{
public:
  explicit Layout(const Cloud & cloud)
  : big_endian_(cloud.is_bigendian)
  {
    constexpr std::array<std::uint8_t, 9> sizes = {0, 1, 1, 2, 2, 4, 4, 4, 8};
    for (const Field & field : cloud.fields) {
      if (field.count > 1 || field.name.empty()) {
        continue;
      }
      const std::string what = "point cloud field '" + field.name + "'";
      if (field.datatype < 1 || field.datatype >= sizes.size()) {
        throw DecodeError(
                what + " has datatype " + std::to_string(field.datatype) + ", expected 1 to 8");
      }
      const std::uint64_t end = std::uint64_t{field.offset} + sizes[field.datatype];
      if (end > cloud.point_step) {
        throw DecodeError(
                what + " ends at byte " + std::to_string(end) + ", expected at most point_step = " +
                std::to_string(cloud.point_step));
      }
      if (!columns_.emplace(field.name, Column{field.offset, field.datatype}).second) {
        throw DecodeError("point cloud has two fields of the name '" + field.name + "'");
      }
    }
  }

  /// Column of a float of either size, of a UINT32 or of a UINT8; nothing if it is not there.
  std::optional<Column> find(const std::string & name, std::uint8_t datatype) const
  {
    const auto found = columns_.find(name);
    if (found == columns_.end()) {
      return std::nullopt;
    }
    const std::uint8_t given = found->second.datatype;
    if (given != datatype && !(datatype == FLOAT32 && given == FLOAT64)) {
      throw DecodeError(
              "point cloud field '" + name + "' has datatype " + std::to_string(given) +
              ", expected " + std::to_string(datatype) + ", so it holds no predictions");
    }
    return found->second;
  }

  /// The same of a column that must be there.
  Column get(const std::string & name, std::uint8_t datatype) const
  {
    const auto found = find(name, datatype);
    if (!found) {
      throw DecodeError("point cloud lacks the field " + name + ", so it holds no predictions");
    }
    return *found;
  }

  double number(const std::uint8_t * point, const Column & column) const
  {
    if (column.datatype == FLOAT64) {
      const auto bits = load<std::uint64_t>(point + column.offset, big_endian_);
      double value;
      static_assert(sizeof(value) == sizeof(bits), "IEEE 754 double");
      std::memcpy(&value, &bits, sizeof(value));
      return value;
    }
    const auto bits = load<std::uint32_t>(point + column.offset, big_endian_);
    float value;
    static_assert(sizeof(value) == sizeof(bits), "IEEE 754 float");
    std::memcpy(&value, &bits, sizeof(value));
    return static_cast<double>(value);
  }

  std::uint32_t word(const std::uint8_t * point, const Column & column) const
  {
    return load<std::uint32_t>(point + column.offset, big_endian_);
  }

private:
  std::map<std::string, Column> columns_;
  bool big_endian_;
};

/// Addresses of the points of a cloud, after its sizes were compared with its data.
inline std::vector<const std::uint8_t *> points_of(const Cloud & cloud)
{
  const std::uint64_t rows = cloud.height;
  const std::uint64_t columns = cloud.width;
  std::vector<const std::uint8_t *> points;
  if (rows == 0 || columns == 0) {
    return points;
  }
  if (cloud.point_step == 0) {
    throw DecodeError("point cloud has point_step 0");
  }
  const std::uint64_t needed = columns * cloud.point_step;
  if (rows > 1 && cloud.row_step < needed) {
    throw DecodeError(
            "point cloud has row_step " + std::to_string(cloud.row_step) +
            ", expected at least width x point_step = " + std::to_string(needed));
  }
  if (needed > cloud.size || (rows - 1) * cloud.row_step > cloud.size - needed) {
    throw DecodeError(
            "point cloud has " + std::to_string(cloud.size) + " bytes of data, too few for " +
            std::to_string(rows) + " x " + std::to_string(columns) + " points of " +
            std::to_string(cloud.point_step) + " bytes");
  }
  points.reserve(static_cast<std::size_t>(rows * columns));
  for (std::uint64_t row = 0; row < rows; ++row) {
    for (std::uint64_t column = 0; column < columns; ++column) {
      points.push_back(cloud.data + row * cloud.row_step + column * cloud.point_step);
    }
  }
  return points;
}

/// Throws unless times and weights are those of predictions.
inline void check_plausible(const std::vector<double> & times, bool finite, bool weights_fit)
{
  constexpr double latest_s = 1e4;
  constexpr double soonest_s = 1e-3;
  bool fits = finite && weights_fit;
  double last_s = -1.0;
  for (const double t : times) {
    if (!std::isnan(t)) {
      fits = fits && t >= 0.0 && t > last_s;
      last_s = t;
    }
  }
  if (!fits || last_s < soonest_s || last_s > latest_s) {
    throw DecodeError(
            "point cloud has times that do not rise from step to step or weights that are not"
            " between 0 and 1; does is_bigendian say the byte order of its data?");
  }
}

}  // namespace detail

/// The predictions in the content of a PointCloud2.
///
/// Points may have any order and some may be missing, as in a cloud that was filtered. Fields are
/// found by name; the data may have either byte order. The time grows with the number of points.
///
/// \throws DecodeError the cloud does not have the layout of predictions, or contradicts itself
inline Predictions decode(const Cloud & cloud)
{
  using detail::FLOAT32;
  using detail::UINT32;
  using detail::UINT8;
  const detail::Layout layout(cloud);
  const auto points = detail::points_of(cloud);
  const std::array<detail::Column, 8> values = {
    layout.get("x", FLOAT32), layout.get("y", FLOAT32), layout.get("vx", FLOAT32),
    layout.get("vy", FLOAT32), layout.get("yaw", FLOAT32), layout.get("cov_xx", FLOAT32),
    layout.get("cov_xy", FLOAT32), layout.get("cov_yy", FLOAT32)};
  const std::array<double State::*, 8> members = {
    &State::x, &State::y, &State::vx, &State::vy, &State::yaw, &State::cov_xx, &State::cov_xy,
    &State::cov_yy};
  const auto z = layout.get("z", FLOAT32);
  const auto t = layout.get("t", FLOAT32);
  const auto weight = layout.get("weight", FLOAT32);
  const std::array<detail::Column, 4> words = {
    layout.get("id_0", UINT32), layout.get("id_1", UINT32), layout.get("id_2", UINT32),
    layout.get("id_3", UINT32)};
  const auto agent_class = layout.get("class", UINT8);
  const auto mode = layout.get("mode", UINT8);
  const auto step = layout.get("step", UINT8);
  const auto source = layout.get("source", UINT8);
  const auto factor = layout.find("sigma_factor_50", FLOAT32);
  const auto calibration = layout.find("calibration", UINT8);
  const auto x_rest = layout.find("x_rest", FLOAT32);
  const auto y_rest = layout.find("y_rest", FLOAT32);
  const auto length = layout.find("length", FLOAT32);
  const auto width = layout.find("width", FLOAT32);
  const auto positive = [&layout](const std::uint8_t * point, const detail::Column & column) {
      const double value = layout.number(point, column);
      return value > 0.0 && std::isfinite(value) ? value : std::numeric_limits<double>::quiet_NaN();
    };

  Predictions found;
  found.stamp_ns = std::int64_t{cloud.sec} * 1000000000 + std::int64_t{cloud.nanosec};
  found.frame_id = cloud.frame_id;
  std::map<Key, std::size_t> rows;
  std::vector<std::size_t> row_of;
  row_of.reserve(points.size());
  std::size_t modes = 0;
  std::size_t steps = 0;
  for (const std::uint8_t * point : points) {
    Key key{};
    for (std::size_t i = 0; i < 4; ++i) {
      key[i] = layout.word(point, words[i]);
    }
    const auto [row, is_new] = rows.emplace(key, rows.size());
    if (is_new) {
      Agent agent;
      agent.key = key;
      agent.agent_class = point[agent_class.offset];
      agent.source = point[source.offset];
      agent.calibration = factor && calibration ? point[calibration->offset] : 0;
      agent.z = layout.number(point, z);
      if (length && width) {
        agent.length = positive(point, *length);
        agent.width = positive(point, *width);
      }
      found.agents.push_back(agent);
    }
    row_of.push_back(row->second);
    modes = std::max(modes, std::size_t{point[mode.offset]} + 1);
    steps = std::max(steps, std::size_t{point[step.offset]} + 1);
  }
  if (points.empty()) {
    return found;
  }
  // A few points must not claim gigabytes: modes and steps are at most 256 each.
  const std::size_t cells = found.agents.size() * modes * steps;
  if (cells > std::max(std::size_t{1} << 20, 16 * points.size())) {
    throw DecodeError(
            "point cloud has " + std::to_string(points.size()) + " points of " +
            std::to_string(cells) + " that its agents, modes and steps stand for: too few");
  }
  found.modes = modes;
  found.time_s.assign(steps, -std::numeric_limits<double>::infinity());
  found.weights.assign(found.agents.size() * modes, 0.0);
  found.states.assign(cells, State());
  found.factors.assign(found.agents.size() * steps, 0.0);
  std::vector<bool> present(cells, false);
  bool finite = true;
  bool weights_fit = true;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const std::uint8_t * point = points[i];
    const std::size_t m = point[mode.offset];
    const std::size_t h = point[step.offset];
    const std::size_t cell = (row_of[i] * modes + m) * steps + h;
    if (present[cell]) {
      throw DecodeError("point cloud has two points of the same agent, mode and step");
    }
    present[cell] = true;
    State & state = found.states[cell];
    for (std::size_t k = 0; k < values.size(); ++k) {
      state.*members[k] = layout.number(point, values[k]);
    }
    if (x_rest && y_rest) {
      state.x += layout.number(point, *x_rest);
      state.y += layout.number(point, *y_rest);
    }
    const double time_s = layout.number(point, t);
    const double share = layout.number(point, weight);
    finite = finite && std::isfinite(time_s);
    weights_fit = weights_fit && share >= 0.0 && share <= 1.0 + 1e-3;
    found.time_s[h] = std::max(found.time_s[h], time_s);
    double & known = found.weights[row_of[i] * modes + m];
    known = std::max(known, share);
    if (factor && calibration) {
      double & most = found.factors[row_of[i] * steps + h];
      most = std::max(most, layout.number(point, *factor));
    }
  }
  for (double & time_s : found.time_s) {
    time_s = std::isinf(time_s) ? std::numeric_limits<double>::quiet_NaN() : time_s;
  }
  for (double & value : found.factors) {
    value = value > 0.0 ? value : 1.0;
  }
  detail::check_plausible(found.time_s, finite, weights_fit);
  return found;
}

/// The content of a serialised sensor_msgs/PointCloud2, of which `data` stays a part.
///
/// \param data its CDR bytes with the encoding header, of either byte order
/// \param size number of bytes
/// \throws DecodeError the bytes are not plain CDR, or end too early
inline Cloud cloud_from_cdr(const std::uint8_t * data, std::size_t size)
{
  detail::CdrReader reader(data, size);
  Cloud cloud;
  const std::uint32_t sec = reader.word();
  std::memcpy(&cloud.sec, &sec, sizeof(sec));
  cloud.nanosec = reader.word();
  cloud.frame_id = reader.text();
  cloud.height = reader.word();
  cloud.width = reader.word();
  const std::size_t count = reader.word();
  constexpr std::size_t least_field_bytes = 20;  // an empty name, three numbers and padding
  if (count > (reader.rest() + 8) / least_field_bytes) {
    throw DecodeError("point cloud claims " + std::to_string(count) + " fields, too many for " +
            std::to_string(reader.rest()) + " bytes");
  }
  cloud.fields.resize(count);
  for (Field & field : cloud.fields) {
    field.name = reader.text();
    field.offset = reader.word();
    field.datatype = reader.octet();
    field.count = reader.word();
  }
  cloud.is_bigendian = reader.octet() != 0;
  cloud.point_step = reader.word();
  cloud.row_step = reader.word();
  cloud.size = reader.word();
  cloud.data = reader.take(cloud.size);
  reader.octet();  // is_dense
  return cloud;
}

/// The predictions in a serialised sensor_msgs/PointCloud2.
///
/// \throws DecodeError see cloud_from_cdr() and decode()
inline Predictions decode_cdr(const std::uint8_t * data, std::size_t size)
{
  return decode(cloud_from_cdr(data, size));
}

}  // namespace mtpgo_ros

#endif  // MTPGO_ROS__PREDICTIONS_HPP_
