#pragma once

// Short names for Asio, in one place. Include the fine-grained <boost/asio/...> headers where used;
// the implementation is compiled once, in asio.cpp.

#include <utility>  // Boost 1.81's awaitable needs std::exchange before it

namespace boost::asio {}
namespace trocar {
namespace asio = boost::asio;
}
