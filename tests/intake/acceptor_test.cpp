// Sockets of two addresses come to an acceptor on the test's only I/O context, and say nothing or
// something.

#include "common/intake/acceptor.h"

#include <gtest/gtest.h>

#include <boost/asio/read.hpp>
#include <boost/asio/write.hpp>
#include <map>
#include <string>
#include <vector>

#include "common/base/no_throw.h"

namespace trocar::intake {
namespace {

using tcp = asio::ip::tcp;
constexpr const char* kOne = "127.0.0.1";
constexpr const char* kTwo = "127.0.0.2";

class Door {
 public:
  explicit Door(const Limits& limits) : acceptor_(io_, limits) {
    EXPECT_TRUE(acceptor_.open(kOne, 0, "test").ok());
    acceptor_.start(
        [this](auto socket, auto peer) { return serve(std::move(socket), std::move(peer)); });
  }

  void come(const char* from) {
    auto& socket = sockets_.emplace_back(own_);
    socket.open(tcp::v4());
    socket.bind({asio::ip::make_address(from), 0});
    socket.connect({asio::ip::make_address(kOne), acceptor_.port()});
    run();
  }
  void say_something(std::size_t number) {
    asio::write(sockets_[number], asio::buffer("x", 1));
    run();
  }
  void run() { io_.run_for(std::chrono::milliseconds(10)); }

  // Those who were cut, by the order in which they came.
  std::map<std::size_t, Acceptor::Cut> cut;
  Acceptor& acceptor() { return acceptor_; }

 private:
  asio::awaitable<void> serve(tcp::socket socket, std::unique_ptr<Acceptor::Peer> peer) {
    const auto number = served_++;
    peer->set_cut([this, number, &socket](Acceptor::Cut why) {
      cut[number] = why;
      socket.close();
    });
    std::string byte(1, ' ');
    while (true) {
      const auto [error, count] = co_await asio::async_read(socket, asio::buffer(byte), kNoThrow);
      if (error) co_return;
      peer->speak();
    }
  }

  asio::io_context io_{1}, own_{1};
  Acceptor acceptor_;
  std::size_t served_ = 0;
  std::vector<tcp::socket> sockets_;
};

TEST(Acceptor, the_oldest_who_is_silent_makes_room_first_of_the_address_that_has_most) {
  Door door({.most = 4});
  for (const auto* from : {kTwo, kOne, kOne}) door.come(from);
  door.say_something(1);
  for (const auto* from : {kOne, kTwo, kTwo}) door.come(from);
  EXPECT_EQ(door.cut.size(), 2u);
  EXPECT_TRUE(door.cut.contains(2)) << "of two and two the older";
  EXPECT_TRUE(door.cut.contains(0)) << "the oldest of the address that has most";
  EXPECT_EQ(door.acceptor().counters().cut, 2u);
  EXPECT_EQ(door.acceptor().counters().accepted, 6u);
}

TEST(Acceptor, an_address_makes_room_for_itself_and_who_has_spoken_stays) {
  Door door({.most = 4, .most_per_address = 2});
  for (const auto* from : {kTwo, kOne, kOne}) door.come(from);
  door.say_something(1);
  door.come(kOne);
  EXPECT_EQ(door.cut.size(), 1u);
  EXPECT_TRUE(door.cut.contains(2));
  door.say_something(3);
  door.come(kOne);
  EXPECT_EQ(door.cut.size(), 1u);
  EXPECT_EQ(door.acceptor().counters().refused, 1u);
  door.acceptor().cut_all();
  door.run();
  EXPECT_EQ(door.cut.size(), 4u);
  EXPECT_EQ(door.acceptor().count(), 0);
}

TEST(Acceptor, fewer_may_be_silent_than_there_are_connections) {
  Door door({.most = 8, .most_silent = 1});
  door.come(kOne);
  door.say_something(0);
  door.come(kOne);
  door.come(kTwo);
  EXPECT_EQ(door.cut, (std::map<std::size_t, Acceptor::Cut>{{1, Acceptor::Cut::NoRoom}}));
}

TEST(Acceptor, who_says_nothing_is_cut_when_its_time_is_over) {
  Door door({.most = 4, .time_to_speak = std::chrono::milliseconds(1)});
  door.come(kOne);
  while (door.cut.empty()) door.run();
  EXPECT_EQ(door.cut.at(0), Acceptor::Cut::Late);
}

TEST(Acceptor, a_bad_or_taken_address_is_an_error) {
  asio::io_context io;
  Acceptor first(io, {.most = 1}), second(io, {.most = 1});
  EXPECT_EQ(first.open("nowhere", 0, "listen").error().code, ErrorCode::Usage);
  ASSERT_TRUE(first.open(kOne, 0, "listen").ok());
  EXPECT_EQ(second.open(kOne, first.port(), "listen").error().code, ErrorCode::ResourceMissing);
}

}  // namespace
}  // namespace trocar::intake
