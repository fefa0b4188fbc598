#include "client/device/shared_object.h"

#include <dlfcn.h>

#include "common/base/printable.h"

namespace trocar::device {

Result<SharedObject> SharedObject::open(const std::vector<std::string>& names,
                                        const std::string& advice) {
  SharedObject library;
  std::string why;
  for (const auto& name : names) {
    library.name_ = name;
    library.handle_ = dlopen(name.c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_NODELETE);
    if (library.handle_ != nullptr) return library;
    const char* text = dlerror();
    if (why.empty()) why = printable(text == nullptr ? name : text, 300);
  }
  return Error{ErrorCode::ResourceMissing, why + ", " + advice};
}

void* SharedObject::address_of(const char* name) {
  void* address = dlsym(handle_, name);
  if (address == nullptr) missing_ += std::string(missing_.empty() ? "" : " ") + name;
  return address;
}

Status SharedObject::check() const {
  if (missing_.empty()) return {};
  return Error{ErrorCode::Mismatch,
               name_ + " has no " + missing_ + ", install a newer version of it"};
}

}  // namespace trocar::device
