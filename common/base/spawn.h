#pragma once

// Starts a coroutine that nobody awaits. Asio's own function is a template of the coroutine's
// executor and of what is called at its end, and each pair costs its source about a second to
// compile: here there is one.

#include "common/base/asio.h"  // before Boost: see there

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/awaitable.hpp>
#include <exception>
#include <functional>

namespace trocar {

// `ended` is called on the executor, with what the coroutine threw, or null: `rethrow`, if nothing
// else.
void spawn(asio::any_io_executor executor, asio::awaitable<void> work,
           std::function<void(std::exception_ptr)> ended);

}  // namespace trocar
