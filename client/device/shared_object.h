#pragma once

// A maker's library that may or may not be on this computer: found when the program runs, so that
// it is needed neither to build nor to start. It stays loaded until the program ends, because such
// libraries have threads of their own.

#include <string>
#include <vector>

#include "common/base/result.h"

namespace trocar::device {

class SharedObject {
 public:
  // Takes the first of `names` that can be loaded. `advice` says how to get it.
  static Result<SharedObject> open(const std::vector<std::string>& names,
                                   const std::string& advice);

  // Sets `function`, or notes that its name is missing.
  template <typename Function>
  void bind(const char* name, Function*& function) {
    function = reinterpret_cast<Function*>(address_of(name));
  }
  // An error names all that bind() did not find.
  Status check() const;

 private:
  void* address_of(const char* name);

  void* handle_ = nullptr;
  std::string name_, missing_;
};

}  // namespace trocar::device
