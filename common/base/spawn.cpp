#include "common/base/spawn.h"

#include <boost/asio/co_spawn.hpp>
#include <utility>

namespace trocar {

void spawn(asio::any_io_executor executor, asio::awaitable<void> work,
           std::function<void(std::exception_ptr)> ended) {
  asio::co_spawn(std::move(executor), std::move(work), std::move(ended));
}

}  // namespace trocar
