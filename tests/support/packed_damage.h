#pragma once

// Damage to .reduction files, which are packed (server/organs/organ/packed_file.h), that their
// reader must notice.

#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "common/base/bytes.h"
#include "common/base/result.h"

namespace trocar::testing {

// Expects one line that begins with the file's path and says what is wrong with it.
inline void expect_bad_file(const Error& error, const std::string& path, const std::string& says) {
  EXPECT_EQ(error.code, ErrorCode::BadFile);
  EXPECT_TRUE(error.message.starts_with(path + ": ")) << error.message;
  EXPECT_NE(error.message.find(says), std::string::npos) << error.message;
  EXPECT_EQ(error.message.find('\n'), std::string::npos) << error.message;
}

// `is_read` says whether bytes are read at all, `is_equal_if_read` whether they are refused or give
// what was written, and `expect_bad` expects a line that says what is wrong. Beyond the first 100,
// one byte in `stride` is tried.
inline void expect_damage_is_noticed(
    const Bytes& file, std::size_t stride, const std::function<bool(BytesView)>& is_read,
    const std::function<bool(BytesView)>& is_equal_if_read,
    const std::function<void(BytesView, const std::string&)>& expect_bad) {
  const auto next = [&](std::size_t i) { return i + (i < 100 ? 1 : stride); };
  for (std::size_t length = 0; length < file.size(); length = next(length))
    EXPECT_FALSE(is_read(BytesView(file).first(length))) << length;
  for (std::size_t i = 0; i < file.size(); i = next(i)) {
    auto flipped = file;
    flipped[i] ^= 0x10;
    EXPECT_TRUE(is_equal_if_read(flipped)) << i;  // zstd leaves a bit of its own unused
  }
  expect_bad(BytesView(file).first(10), "is cut off in its header");
  expect_bad(BytesView(file).first(file.size() - 5), "cut off");
  auto longer = file;
  longer.push_back(0);
  expect_bad(longer, "has bytes behind its body");
  auto damaged = file;
  damaged[20] ^= 1;  // of the checksum
  expect_bad(damaged, "its checksum does not fit");
  expect_bad(Bytes{}, "is not a .reduction file");
}

}  // namespace trocar::testing
