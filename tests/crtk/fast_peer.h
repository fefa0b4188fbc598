#pragma once

// A program of another maker's DDS, Fast DDS, which knows nothing of ours: samples are bytes as
// they are on the wire, from their encapsulation on.

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

namespace eprosima::fastdds::dds {
class DataWriter;
class DomainParticipant;
class TopicDataType;
}  // namespace eprosima::fastdds::dds

namespace trocar::crtk {

using Sample = std::vector<std::uint8_t>;

// Other tests may talk on this machine at the same time.
std::uint32_t domain_of_this_process();

class FastPeer {
 public:
  FastPeer();
  ~FastPeer();
  FastPeer(const FastPeer&) = delete;
  FastPeer& operator=(const FastPeer&) = delete;

  // Both are as subscribers and publishers of ROS 2 are: reliable, volatile, the last ten.
  // `is_latched`: also what was said before.
  void hear(const std::string& topic, const std::string& type, bool is_latched = false);
  void say(const std::string& topic, const std::string& type, const Sample& sample);

  // All that came and was not taken; the newest alone.
  std::vector<Sample> take(const std::string& topic);
  Sample newest(const std::string& topic) const;

 private:
  class Type;
  class Listener;

  std::string registered(const std::string& type);

  eprosima::fastdds::dds::DomainParticipant* participant_;
  std::map<std::string, eprosima::fastdds::dds::DataWriter*> writers_;
  std::vector<std::unique_ptr<Listener>> listeners_;
  mutable std::mutex mutex_;
  std::map<std::string, std::vector<Sample>> heard_;
  std::map<std::string, Sample> newest_;
};

}  // namespace trocar::crtk
