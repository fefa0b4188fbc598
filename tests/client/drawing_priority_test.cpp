// Drawing in software yields to everything else, and nothing else does.

#include "client/render/drawing_priority.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <latch>
#include <thread>

#include "client/render/gl_context.h"

namespace trocar::render {
namespace {

int niceness_of_this_thread() {
  return getpriority(PRIO_PROCESS, static_cast<id_t>(gettid()));
}

TEST(DrawingPriority, ThreadsThatDrawYieldAndOthersKeepTheirs) {
  const int before = niceness_of_this_thread();
  std::latch has_yielded(1);
  int of_another = -1;
  std::thread another([&] {
    has_yielded.wait();
    of_another = niceness_of_this_thread();
  });
  int count = 0, of_drawing = -1;
  std::thread drawing([&] {
    const auto context = make_headless_context({64, 64});
    EXPECT_TRUE(context.ok());
    const bool is_llvmpipe = (*context)->renderer_name().find("llvmpipe") != std::string::npos;
    count = yield_to_other_work();
    of_drawing = niceness_of_this_thread();
    EXPECT_TRUE(!is_llvmpipe || count >= 2) << "Mesa draws with threads of its own";
    has_yielded.count_down();
  });
  drawing.join();
  another.join();
  EXPECT_GE(count, 1);
  EXPECT_EQ(of_drawing, std::max(10, before));
  EXPECT_EQ(of_another, before);
  EXPECT_EQ(niceness_of_this_thread(), before);
}

}  // namespace
}  // namespace trocar::render
