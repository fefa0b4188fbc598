#pragma once

// Short names for Asio, in one place. Include the fine-grained <boost/asio/...> headers where used;
// the implementation is compiled once, in asio.cpp.

#include <exception>
#include <utility>  // Boost 1.81's awaitable needs std::exchange before it

namespace boost::asio {}
namespace trocar {
namespace asio = boost::asio;

// For completion handlers of coroutines that nobody awaits: what such a coroutine throws leaves
// io_context::run(), and whoever runs that ends with a reason.
inline void rethrow(const std::exception_ptr& failure) {
  if (failure) std::rethrow_exception(failure);
}
}  // namespace trocar
