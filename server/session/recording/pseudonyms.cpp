#include "server/session/recording/pseudonyms.h"

#include <algorithm>
#include <cctype>
#include <functional>

namespace trocar::recording {
namespace {

bool belongs_to_word(char c) {
  const auto byte = static_cast<unsigned char>(c);
  return byte >= 0x80 || std::isalnum(byte) != 0;
}

bool stands_at(const std::string& text, std::size_t at, const std::string& name) {
  const std::size_t end = at + name.size();
  return text.compare(at, name.size(), name) == 0 &&
         (at == 0 || !belongs_to_word(text[at - 1]) || !belongs_to_word(name.front())) &&
         (end == text.size() || !belongs_to_word(text[end]) || !belongs_to_word(name.back()));
}

}  // namespace

void Pseudonyms::add(const std::string& name) {
  if (name.empty() || names_.contains(name)) return;
  const std::string pseudonym = "Person " + std::to_string(names_.size() + 1);
  names_.emplace(name, pseudonym);
  by_length_.push_back(name);
  std::ranges::stable_sort(by_length_, std::greater{}, &std::string::size);
}

std::string Pseudonyms::of_name(const std::string& name) const {
  const auto known = names_.find(name);
  return known == names_.end() ? name : known->second;
}

std::string Pseudonyms::within(const std::string& text) const {
  std::string out;
  for (std::size_t at = 0; at < text.size();) {
    const auto name = std::ranges::find_if(
        by_length_, [&](const std::string& one) { return stands_at(text, at, one); });
    if (name == by_length_.end()) {
      out += text[at++];
    } else {
      out += names_.at(*name);
      at += name->size();
    }
  }
  return out;
}

}  // namespace trocar::recording
