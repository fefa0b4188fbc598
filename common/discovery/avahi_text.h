#pragma once

// Lists of TXT records, to Avahi's form and back.

#include <avahi-common/strlst.h>

#include <memory>
#include <string>
#include <vector>

namespace trocar::discovery {

using TextList = std::unique_ptr<AvahiStringList, decltype(&avahi_string_list_free)>;

inline TextList to_list(const std::vector<std::string>& records) {
  AvahiStringList* list = nullptr;
  for (const auto& record : records)
    list = avahi_string_list_add_arbitrary(
        list, reinterpret_cast<const std::uint8_t*>(record.data()), record.size());
  return {list, avahi_string_list_free};
}

inline std::vector<std::string> from_list(AvahiStringList* list, std::size_t limit) {
  std::vector<std::string> records;
  for (auto* item = list; item != nullptr && records.size() < limit;
       item = avahi_string_list_get_next(item))
    records.emplace_back(reinterpret_cast<const char*>(avahi_string_list_get_text(item)),
                         avahi_string_list_get_size(item));
  return records;
}

}  // namespace trocar::discovery
