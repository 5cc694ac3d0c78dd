// Nodes of ROS 2 as far as DDS sees them, by Fast DDS 2.9 (Debian: libfastrtps-dev), with the
// settings of rmw_fastrtps_cpp. Messages are passed on as bytes.
//
// ros2_fastdds play FILE SPEED   publishes messages: what `ros2_cyclone.py frames` wrote
// ros2_fastdds echo              prints the odometry of ours as rows: nanoseconds, x, y
// ros2_fastdds call SERVICE      calls a std_srvs/Trigger, prints its response
// ros2_fastdds bench SECONDS     publishes clouds of 10,000 points at 5 Hz and IMU samples at 250 Hz,
//                                stamped as they go, and prints odometry that comes: its stamp and
//                                when it came, ns
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fstream>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

using namespace eprosima::fastdds::dds;
using eprosima::fastrtps::rtps::GUID_t;
using eprosima::fastrtps::rtps::InstanceHandle_t;
using eprosima::fastrtps::rtps::SerializedPayload_t;
using Clock = std::chrono::steady_clock;
using Bytes = std::vector<unsigned char>;

// Seconds until others have to have been found.
const auto FOUND_MAX = std::chrono::seconds(20);

// A type whose messages are bytes of CDR behind its header.
class AsBytes : public TopicDataType {
 public:
  explicit AsBytes(const std::string& name) {
    setName(name.c_str());
    m_typeSize = 1024;
  }
  bool serialize(void* data, SerializedPayload_t* payload) override {
    const auto& bytes = *static_cast<Bytes*>(data);
    payload->reserve(bytes.size());
    std::memcpy(payload->data, bytes.data(), bytes.size());
    payload->length = bytes.size();
    payload->encapsulation = CDR_LE;
    return true;
  }
  bool deserialize(SerializedPayload_t* payload, void* data) override {
    static_cast<Bytes*>(data)->assign(payload->data, payload->data + payload->length);
    return true;
  }
  std::function<uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return uint32_t(static_cast<Bytes*>(data)->size()); };
  }
  void* createData() override { return new Bytes; }
  void deleteData(void* data) override { delete static_cast<Bytes*>(data); }
  bool getKey(void*, InstanceHandle_t*, bool) override { return false; }
};

DomainParticipant* participant;
Publisher* publisher;
Subscriber* subscriber;

Topic* topic(const std::string& name, const std::string& type_name) {
  TypeSupport type(new AsBytes(type_name));
  type.register_type(participant);
  return participant->create_topic(name, type_name, TOPIC_QOS_DEFAULT);
}

template <typename Qos>
Qos quality(Qos qos, bool is_kept, int depth) {
  qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
  qos.durability().kind = is_kept ? TRANSIENT_LOCAL_DURABILITY_QOS : VOLATILE_DURABILITY_QOS;
  qos.history().kind = KEEP_LAST_HISTORY_QOS;
  qos.history().depth = depth;
  qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  return qos;
}

DataWriter* writer(Topic* topic, bool is_kept, int depth) {
  return publisher->create_datawriter(topic, quality(DATAWRITER_QOS_DEFAULT, is_kept, depth));
}

DataReader* reader(Topic* topic, bool is_kept, int depth) {
  return subscriber->create_datareader(topic, quality(DATAREADER_QOS_DEFAULT, is_kept, depth));
}

// Waits until something holds.
template <typename Holds>
bool found(Holds holds) {
  for (auto begin = Clock::now(); Clock::now() < begin + FOUND_MAX;) {
    if (holds()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return false;
}

// A message, read from its beginning.
struct Wire {
  const Bytes& bytes;
  size_t at = 4;
  template <typename T>
  T number() {
    at = 4 + (at - 4 + sizeof(T) - 1) / sizeof(T) * sizeof(T);
    T value;
    std::memcpy(&value, &bytes.at(at + sizeof(T) - 1) - (sizeof(T) - 1), sizeof(T));
    at += sizeof(T);
    return value;
  }
  std::string text() {
    auto length = number<uint32_t>();
    std::string value(reinterpret_cast<const char*>(&bytes.at(at)), length ? length - 1 : 0);
    at += length;
    return value;
  }
};

int play(const char* path, double speed) {
  struct Message {
    DataWriter* to;
    int64_t at_ns;
    Bytes bytes;
  };
  std::ifstream in(path, std::ios::binary);
  std::map<std::string, DataWriter*> writers;
  std::vector<Message> messages;
  auto read = [&](auto& value) { return bool(in.read(reinterpret_cast<char*>(&value), sizeof value)); };
  auto text = [&](std::string& value) {
    uint32_t length;
    if (!read(length)) return false;
    value.resize(length);
    return bool(in.read(&value[0], length));
  };
  for (std::string name, type_name; text(name) && text(type_name);) {
    Message message;
    uint32_t length = 0;
    if (!read(message.at_ns) || !read(length)) break;
    message.bytes.resize(length);
    in.read(reinterpret_cast<char*>(message.bytes.data()), length);
    auto& to = writers[name];
    bool is_kept = name == "rt/tf_static";
    if (!to) to = writer(topic(name, type_name), is_kept, is_kept ? 1 : 100);
    message.to = to;
    messages.push_back(std::move(message));
  }
  auto all_matched = [&] {
    for (auto& entry : writers) {
      PublicationMatchedStatus status;
      entry.second->get_publication_matched_status(status);
      if (!status.current_count) return false;
    }
    return !writers.empty();
  };
  if (!found(all_matched)) return std::puts("nobody subscribes"), 1;
  // A subscriber that has asked for the least may ask for more, now that all are known.
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  int64_t first_ns = INT64_MAX;
  for (auto& message : messages) first_ns = std::min(first_ns, message.at_ns);
  auto begin = Clock::now();
  for (auto& message : messages) {
    auto due = std::chrono::nanoseconds(int64_t((message.at_ns - first_ns) / speed));
    std::this_thread::sleep_until(begin + due);
    message.to->write(&message.bytes);
  }
  bool is_taken = true;
  for (auto& entry : writers) {
    is_taken &= entry.second->wait_for_acknowledgments({10, 0}) == ReturnCode_t::RETCODE_OK;
  }
  std::printf("%zu %s\n", messages.size(), is_taken ? "acknowledged" : "not acknowledged");
  return 0;
}

int echo() {
  auto from = reader(topic("rt/randt/odometry", "nav_msgs::msg::dds_::Odometry_"), false, 1000);
  for (Bytes bytes;;) {
    SampleInfo info;
    if (from->take_next_sample(&bytes, &info) != ReturnCode_t::RETCODE_OK) {
      from->wait_for_unread_message({1, 0});
      continue;
    }
    if (!info.valid_data) continue;
    Wire wire{bytes};
    int64_t stamp_ns = wire.number<int32_t>() * INT64_C(1000000000);
    stamp_ns += wire.number<uint32_t>();
    auto frame = wire.text(), child = wire.text();
    double x_m = wire.number<double>(), y_m = wire.number<double>();
    if (frame != "odom" || child != "base_link") return std::puts("other frames"), 1;
    std::printf("%lld %.9f %.9f\n", static_cast<long long>(stamp_ns), x_m, y_m);
    std::fflush(stdout);
  }
}

int call(const std::string& service) {
  auto to = writer(topic("rq" + service + "Request", "std_srvs::srv::dds_::Trigger_Request_"), false, 10);
  auto from = reader(topic("rr" + service + "Reply", "std_srvs::srv::dds_::Trigger_Response_"), false, 10);
  auto is_matched = [&] {
    PublicationMatchedStatus published;
    SubscriptionMatchedStatus subscribed;
    to->get_publication_matched_status(published);
    from->get_subscription_matched_status(subscribed);
    return published.current_count && subscribed.current_count;
  };
  if (!found(is_matched)) return std::puts("no service"), 1;
  // As rmw_fastrtps_cpp: the reader of replies is named, the request's number comes back.
  eprosima::fastrtps::rtps::WriteParams parameters;
  parameters.related_sample_identity().writer_guid(from->guid());
  Bytes request = {0, 1, 0, 0, 0};
  to->write(&request, parameters);
  auto number = parameters.sample_identity().sequence_number();
  Bytes bytes;
  auto is_answered = [&] {
    SampleInfo info;
    while (from->take_next_sample(&bytes, &info) == ReturnCode_t::RETCODE_OK) {
      auto& related = info.related_sample_identity;
      bool is_own = related.writer_guid() == from->guid() || related.writer_guid() == to->guid();
      if (info.valid_data && is_own && related.sequence_number() == number) return true;
    }
    return false;
  };
  if (!found(is_answered)) return std::puts("no reply"), 1;
  Wire wire{bytes};
  auto is_good = wire.number<uint8_t>();
  std::printf("%d %s\n", is_good, wire.text().c_str());
  return 0;
}

// Writes a message of CDR.
struct Pen {
  Bytes bytes = {0, 1, 0, 0};
  template <typename T>
  void number(T value) {
    while ((bytes.size() - 4) % sizeof(T)) bytes.push_back(0);
    auto* first = reinterpret_cast<unsigned char*>(&value);
    bytes.insert(bytes.end(), first, first + sizeof(T));
  }
  void text(const std::string& value) {
    number(uint32_t(value.size() + 1));
    bytes.insert(bytes.end(), value.c_str(), value.c_str() + value.size() + 1);
  }
};

int64_t now_ns() {
  auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::nanoseconds>(now).count();
}

// A square room, a turn of 220 beams, as an iSDR-C has it, with 46 returns behind each other.
Bytes cloud() {
  const int BEAMS = 220, RETURNS = 46;
  Pen pen;
  pen.number(int32_t(0)), pen.number(uint32_t(0)), pen.text("radar");
  pen.number(uint32_t(1)), pen.number(uint32_t(BEAMS * RETURNS)), pen.number(uint32_t(4));
  const char* names[] = {"x", "y", "z", "intensity"};
  for (uint32_t field = 0; field < 4; ++field) {
    pen.text(names[field]), pen.number(4 * field), pen.number(uint8_t(7)), pen.number(uint32_t(1));
  }
  pen.number(uint8_t(0)), pen.number(uint32_t(16)), pen.number(uint32_t(16 * BEAMS * RETURNS));
  pen.number(uint32_t(16 * BEAMS * RETURNS));
  for (int beam = 0; beam < BEAMS; ++beam) {
    double azimuth = 2 * M_PI * beam / BEAMS, x = std::cos(azimuth), y = std::sin(azimuth);
    double wall = 5 / std::max(std::abs(x), std::abs(y));
    for (int i = 0; i < RETURNS; ++i) {
      double range = wall + 0.05 * i;
      for (double value : {range * x, range * y, 0.0, 60.0 - i}) pen.number(float(value));
    }
  }
  pen.number(uint8_t(1));
  return pen.bytes;
}

Bytes imu() {
  Pen pen;
  pen.number(int32_t(0)), pen.number(uint32_t(0)), pen.text("imu");
  for (int i = 0; i < 37; ++i) pen.number(i == 3 ? 1.0 : i == 27 ? 9.81 : 0.0);
  return pen.bytes;
}

int bench(double seconds) {
  auto clouds = writer(topic("rt/radar/returns", "sensor_msgs::msg::dds_::PointCloud2_"), false, 10);
  auto samples = writer(topic("rt/imu/data", "sensor_msgs::msg::dds_::Imu_"), false, 100);
  auto states = reader(topic("rt/randt/odometry", "nav_msgs::msg::dds_::Odometry_"), false, 10);
  PublicationMatchedStatus status;
  auto is_matched = [&] { return clouds->get_publication_matched_status(status), status.current_count > 0; };
  if (!found(is_matched)) return std::puts("nobody subscribes"), 1;
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  std::thread receive([&] {
    Bytes bytes;
    SampleInfo info;
    for (auto begin = Clock::now(); Clock::now() - begin < std::chrono::duration<double>(seconds + 1);) {
      if (!states->wait_for_unread_message({1, 0})) continue;
      while (states->take_next_sample(&bytes, &info) == ReturnCode_t::RETCODE_OK) {
        Wire wire{bytes};
        int64_t stamp_ns = wire.number<int32_t>() * INT64_C(1000000000);
        stamp_ns += wire.number<uint32_t>();
        std::printf("%lld %lld\n", static_cast<long long>(stamp_ns), static_cast<long long>(now_ns()));
      }
    }
  });
  Bytes cloud_bytes = cloud(), imu_bytes = imu();
  auto send = [](DataWriter* to, Bytes& bytes) {
    int64_t stamp_ns = now_ns();
    int32_t whole_s = stamp_ns / 1000000000;
    uint32_t rest_ns = stamp_ns % 1000000000;
    std::memcpy(&bytes[4], &whole_s, 4), std::memcpy(&bytes[8], &rest_ns, 4);
    to->write(&bytes);
  };
  auto begin = Clock::now();
  for (int i = 0; i < 250 * seconds; ++i) {
    std::this_thread::sleep_until(begin + std::chrono::milliseconds(4 * i));
    send(samples, imu_bytes);
    if (i % 50 == 0) send(clouds, cloud_bytes);
  }
  receive.join();
  return 0;
}

int main(int count, char** arguments) {
  std::string what = count > 1 ? arguments[1] : "";
  auto qos = PARTICIPANT_QOS_DEFAULT;
  // Without shared memory, which one that is killed leaves behind.
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(
      std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>());
  participant = DomainParticipantFactory::get_instance()->create_participant(0, qos);
  publisher = participant->create_publisher(PUBLISHER_QOS_DEFAULT);
  subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
  if (what == "play" && count == 4) return play(arguments[2], std::stod(arguments[3]));
  if (what == "echo") return echo();
  if (what == "bench" && count == 3) return bench(std::stod(arguments[2]));
  if (what == "call" && count == 3) return call(arguments[2]);
  return 2;
}
