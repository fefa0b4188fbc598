// A session's address that is silent takes no time away from the next one.

#include "server/watch/follow/session_link.h"

#include <gtest/gtest.h>

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <exception>
#include <optional>
#include <string>

#include "server/watch/follow/sessions.h"

namespace trocar::follow {
namespace {

using tcp = asio::ip::tcp;

// Accepts one connection, and never says a word.
struct SilentPlace {
  explicit SilentPlace(asio::io_context& context)
      : acceptor(context, {asio::ip::address_v4::loopback(), 0}), accepted(context) {
    acceptor.async_accept(accepted,
                          [this](boost::system::error_code error) { was_tried = !error; });
  }
  std::string name() const { return "127.0.0.1:" + std::to_string(port()); }
  std::uint16_t port() const { return acceptor.local_endpoint().port(); }

  tcp::acceptor acceptor;
  tcp::socket accepted;
  bool was_tried = false;
};

TEST(SessionLink, a_silent_address_is_left_and_the_next_one_tried) {
  asio::io_context context;
  SilentPlace own(context), further(context);
  const SessionAddress session{own.name(), "127.0.0.1", own.port()};
  Sessions sessions({session});
  sessions.note_further(session.name, {}, further.name());
  SessionLink link(context.get_executor(), sessions);
  std::optional<bool> is_open;
  asio::co_spawn(context, link.open(session), [&](std::exception_ptr failure, bool opened) {
    EXPECT_FALSE(failure);
    is_open = opened;
  });
  context.run();
  ASSERT_TRUE(is_open);
  EXPECT_FALSE(*is_open);
  EXPECT_TRUE(own.was_tried);
  EXPECT_TRUE(further.was_tried);
  EXPECT_TRUE(link.why().starts_with(further.name())) << link.why();
}

}  // namespace
}  // namespace trocar::follow
