#pragma once

// A session on a bus in memory: those who publish it, those who take it, and those who only ask.

#include <gtest/gtest.h>

#include <map>

#include "common/wire/session_messages.h"
#include "server/watch/bus/publisher.h"
#include "server/watch/bus/tap.h"
#include "tests/broadcast/fake_bus.h"
#include "tests/network/session_fixture.h"

namespace trocar::bus {

using proto::Envelope;
using testing::LiveSession;
using testing::RawClient;

inline constexpr const char* kName = "monday";

// One that passes the session on, with a connection to the server of its own.
struct Source {
  Source(FakeBus& bus, asio::io_context& io, LiveSession& from, std::uint64_t id,
         const std::function<std::uint64_t()>& clock_ns)
      : session(from),
        publisher(io.get_executor(), std::make_unique<FakeUpstream>(upstream),
                  std::make_unique<FakeChannel>(bus), {kName, id, clock_ns}) {
    EXPECT_TRUE(publisher.listen().ok());
    publisher.start({.welcome = [this](const auto&) { ++welcomes; },
                     .message =
                         [this](const auto&, const auto&) {
                           ++messages;
                           return Status();
                         },
                     .lost = {},
                     .over = {}});
  }
  // Joins the server, up to the first picture.
  void join(const std::string& name = "Relay") {
    client = std::make_unique<RawClient>(session.port());
    ASSERT_TRUE(client->send(testing::make_hello(name, proto::ROLE_OBSERVER)));
    const auto welcome = client->receive(Envelope::kWelcome);
    ASSERT_TRUE(welcome);
    upstream.is_welcome = true;
    auto told = welcome->welcome();
    told.set_return_token("0123456789abcdef");
    told.add_further_address("10.0.0.7:7690");
    upstream.events.welcome(told);
    pass_on();
  }
  // Hands on what the server says, up to the next FrameState.
  void pass_on() {
    while (const auto message = client->receive()) {
      ASSERT_TRUE(upstream.events.message(*message, wire::encode_envelope(*message)).ok());
      if (message->has_frame_state()) return;
    }
    FAIL() << "the server has closed";
  }
  void say(const Envelope& message) {
    ASSERT_TRUE(upstream.events.message(message, wire::encode_envelope(message)).ok());
  }

  LiveSession& session;
  FakeUpstream::State upstream;
  std::unique_ptr<RawClient> client;
  int welcomes = 0, messages = 0;
  Publisher publisher;
};

// A relay's place behind a tap.
struct Taker {
  Taker(FakeBus& bus, asio::io_context& io, const std::function<std::uint64_t()>& clock_ns)
      : tap(io.get_executor(), std::make_unique<FakeChannel>(bus),
            {.session = kName, .clock_ns = clock_ns}) {
    EXPECT_TRUE(tap.listen().ok());
    tap.start({.welcome =
                   [this](const auto& welcome) {
                     welcomes.push_back(welcome);
                     copy = std::make_unique<follow::SessionCopy>();
                   },
               .message =
                   [this](const auto& message, const auto& framed) {
                     const auto news = copy->take(message, framed);
                     if (copy->needs_keyframe()) {
                       Envelope request;
                       request.mutable_keyframe_request();
                       tap.say(request);
                     }
                     return news.ok() ? Status() : news.error();
                   },
               .lost = [this](const std::string&) { ++losses; },
               .over = [this](wire::EndReason, const std::string& text) { over = text; }});
  }
  // 0: there is no picture.
  std::uint32_t crc() const { return copy && copy->has_frame() ? copy->newest()->surface_crc : 0; }

  std::vector<proto::Welcome> welcomes;
  std::unique_ptr<follow::SessionCopy> copy;
  int losses = 0;
  std::string over;
  Tap tap;
};

// Many that ask for everything, each with a subject of its own.
struct Askers {
  Askers(FakeBus& bus, std::size_t count) : ear(bus), mouth(bus) {
    for (std::size_t i = 0; i < count; ++i)
      EXPECT_TRUE(ear.listen(subject(i), [this, i](auto, const auto&) { ++answered[i]; }).ok());
  }
  std::string subject(std::size_t number) const {
    return Subjects(kName).answers_to(std::to_string(number));
  }
  void ask(std::size_t number) {
    Envelope question;
    question.mutable_keyframe_request();
    mouth.send(Subjects(kName).ask, *wire::encode_envelope(question), subject(number));
  }
  std::size_t answers() const {
    std::size_t all = 0;
    for (const auto& [number, times] : answered) all += times;
    return all;
  }

  std::map<std::size_t, std::size_t> answered;  // times, by number
  FakeChannel ear, mouth;                       // a channel does not hear itself
};

class Broadcast : public ::testing::Test {
 protected:
  Broadcast() {
    make(10);
    first_.join();
    pass(2.0);
  }
  std::unique_ptr<Source> make_source(std::uint64_t id) {
    return std::make_unique<Source>(bus_, io_, session_, id, clock_);
  }
  Taker& come() {
    takers_.push_back(std::make_unique<Taker>(bus_, io_, clock_));
    bus_.deliver();
    return *takers_.back();
  }
  // The clock goes on, and everybody attends to his business ten times a second.
  void pass(double seconds) {
    for (int i = 0; i < seconds * 10; ++i) {
      now_ns_ += 100'000'000;
      first_.publisher.attend();
      for (const auto& other : others_) other->publisher.attend();
      for (const auto& taker : takers_) taker->tap.attend();
      bus_.deliver();
    }
  }
  // The next frame reaches the first source.
  void publish(std::size_t changes, bool is_cut = false) {
    make(changes, is_cut);
    first_.pass_on();
    bus_.deliver();
  }
  // The server publishes the next frame, and nobody has it yet.
  void make(std::size_t changes, bool is_cut = false) {
    const auto frame = session_.make_frame(changes, is_cut);
    newest_crc_ = wire::surface_crc(frame->surface);
    session_.publish_all({frame});
  }

  std::uint32_t newest_crc_ = 0;
  std::uint64_t now_ns_ = 1'000'000'000'000;
  const std::function<std::uint64_t()> clock_ = [this] { return now_ns_; };
  LiveSession session_;
  asio::io_context io_{1};  // it never runs: timers do not matter here
  FakeBus bus_;
  Source first_{bus_, io_, session_, 100, clock_};
  std::vector<std::unique_ptr<Source>> others_;
  std::vector<std::unique_ptr<Taker>> takers_;
};

}  // namespace trocar::bus
