#pragma once

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/as_tuple.hpp>
#include <boost/asio/use_awaitable.hpp>

namespace trocar {

// Coroutines get the error of what they await as a value, not as an exception.
inline constexpr auto kNoThrow = asio::as_tuple(asio::use_awaitable);

}  // namespace trocar
