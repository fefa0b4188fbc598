#include "tests/crtk/fast_peer.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>
#include <chrono>
#include <cstring>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <thread>

namespace trocar::crtk {

namespace dds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;

std::uint32_t domain_of_this_process() {
  return 1 + static_cast<std::uint32_t>(::getpid()) % 90;
}

class FastPeer::Type final : public dds::TopicDataType {
 public:
  explicit Type(const std::string& name) {
    setName(name.c_str());
    m_typeSize = 4096;
    auto_fill_type_object(false);
    auto_fill_type_information(false);
  }

  bool serialize(void* data, rtps::SerializedPayload_t* payload) override {
    const auto& sample = *static_cast<const Sample*>(data);
    if (sample.size() > payload->max_size) return false;
    std::memcpy(payload->data, sample.data(), sample.size());
    payload->length = static_cast<std::uint32_t>(sample.size());
    payload->encapsulation = CDR_LE;
    return true;
  }
  bool deserialize(rtps::SerializedPayload_t* payload, void* data) override {
    static_cast<Sample*>(data)->assign(payload->data, payload->data + payload->length);
    return true;
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return static_cast<std::uint32_t>(static_cast<Sample*>(data)->size()); };
  }
  void* createData() override { return new Sample; }
  void deleteData(void* data) override { delete static_cast<Sample*>(data); }
  bool getKey(void*, rtps::InstanceHandle_t*, bool) override { return false; }
};

class FastPeer::Listener final : public dds::DataReaderListener {
 public:
  Listener(FastPeer& peer, std::string topic) : peer_(peer), topic_(std::move(topic)) {}

  void on_data_available(dds::DataReader* reader) override {
    Sample sample;
    dds::SampleInfo info;
    while (reader->take_next_sample(&sample, &info) == ReturnCode_t::RETCODE_OK) {
      if (!info.valid_data) continue;
      const std::lock_guard lock(peer_.mutex_);
      peer_.newest_[topic_] = sample;
      peer_.heard_[topic_].push_back(sample);
    }
  }

 private:
  using ReturnCode_t = eprosima::fastrtps::types::ReturnCode_t;

  FastPeer& peer_;
  const std::string topic_;
};

FastPeer::FastPeer() {
  const auto domain = domain_of_this_process();
  dds::DomainParticipantQos qos;
  auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList.emplace_back("127.0.0.1");
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(udp);
  for (std::uint32_t i = 0; i < 4; ++i) {
    rtps::Locator_t place;
    rtps::IPLocator::setIPv4(place, "127.0.0.1");
    place.port = 7400 + 250 * domain + 10 + 2 * i;
    qos.wire_protocol().builtin.initialPeersList.push_back(place);
  }
  participant_ = dds::DomainParticipantFactory::get_instance()->create_participant(domain, qos);
  if (participant_ == nullptr) throw std::runtime_error("Fast DDS makes no participant");
}

FastPeer::~FastPeer() {
  participant_->delete_contained_entities();
  dds::DomainParticipantFactory::get_instance()->delete_participant(participant_);
}

std::string FastPeer::registered(const std::string& type) {
  dds::TypeSupport support(new Type(type));
  support.register_type(participant_);
  return type;
}

void FastPeer::hear(const std::string& topic, const std::string& type, bool is_latched) {
  auto* made = participant_->create_topic(topic, registered(type), dds::TOPIC_QOS_DEFAULT);
  auto* subscriber = participant_->create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT);
  dds::DataReaderQos qos;
  qos.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
  qos.history().depth = 10;
  qos.durability().kind =
      is_latched ? dds::TRANSIENT_LOCAL_DURABILITY_QOS : dds::VOLATILE_DURABILITY_QOS;
  listeners_.push_back(std::make_unique<Listener>(*this, topic));
  ASSERT_NE(subscriber->create_datareader(made, qos, listeners_.back().get()), nullptr);
}

void FastPeer::say(const std::string& topic, const std::string& type, const Sample& sample) {
  auto& writer = writers_[topic];
  if (writer == nullptr) {
    auto* made = participant_->create_topic(topic, registered(type), dds::TOPIC_QOS_DEFAULT);
    auto* publisher = participant_->create_publisher(dds::PUBLISHER_QOS_DEFAULT);
    dds::DataWriterQos qos;
    qos.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
    qos.durability().kind = dds::VOLATILE_DURABILITY_QOS;
    qos.history().depth = 10;
    writer = publisher->create_datawriter(made, qos);
    ASSERT_NE(writer, nullptr);
    // A volatile writer says nothing to who is found later.
    dds::PublicationMatchedStatus status;
    for (int i = 0; i < 500 && status.current_count == 0; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      writer->get_publication_matched_status(status);
    }
    ASSERT_GT(status.current_count, 0) << "nobody hears " << topic;
  }
  auto copy = sample;
  ASSERT_TRUE(writer->write(&copy));
}

std::vector<Sample> FastPeer::take(const std::string& topic) {
  const std::lock_guard lock(mutex_);
  return std::exchange(heard_[topic], {});
}

Sample FastPeer::newest(const std::string& topic) const {
  const std::lock_guard lock(mutex_);
  const auto found = newest_.find(topic);
  return found == newest_.end() ? Sample() : found->second;
}

}  // namespace trocar::crtk
