#pragma once

// Every function that reads outside data returns a Result: a value, or an error with one line that
// says what is wrong, where, and what to do. Handle once: pass it on or report it.

#include <string>
#include <utility>
#include <variant>

#include "common/base/assert.h"
#include "common/base/exit_code.h"

namespace trocar {

enum class ErrorCode { Usage, BadFile, BadMessage, Refused, ResourceMissing, Mismatch };

struct Error {
  ErrorCode code = ErrorCode::BadFile;
  std::string message;  // one line, no trailing newline
};

ExitCode exit_code_of(ErrorCode code);

// Prints "program: message" to stderr and returns the exit code for main().
int report(const char* program, const Error& error);

template <typename T>
class [[nodiscard]] Result {
 public:
  Result(T value) : content_(std::in_place_index<0>, std::move(value)) {}      // NOLINT: implicit
  Result(Error error) : content_(std::in_place_index<1>, std::move(error)) {}  // NOLINT: implicit

  bool ok() const { return content_.index() == 0; }
  explicit operator bool() const { return ok(); }
  T& value() {
    TROCAR_ASSERT(ok());
    return std::get<0>(content_);
  }
  const T& value() const {
    TROCAR_ASSERT(ok());
    return std::get<0>(content_);
  }
  T& operator*() { return value(); }
  const T& operator*() const { return value(); }
  T* operator->() { return &value(); }
  const T* operator->() const { return &value(); }
  const Error& error() const {
    TROCAR_ASSERT(!ok());
    return std::get<1>(content_);
  }

 private:
  std::variant<T, Error> content_;
};

template <>
class [[nodiscard]] Result<void> {
 public:
  Result() = default;
  Result(Error error) : failed_(true), error_(std::move(error)) {}  // NOLINT: implicit

  bool ok() const { return !failed_; }
  explicit operator bool() const { return ok(); }
  const Error& error() const {
    TROCAR_ASSERT(failed_);
    return error_;
  }

 private:
  bool failed_ = false;
  Error error_;
};

using Status = Result<void>;

}  // namespace trocar
