#pragma once

// The tags of an XML file one by one, as much of XML as files of VTK hold: elements, attributes in
// quotation marks, comments and declarations. There are no entities and no document types. Views
// point into the text; nothing is copied but the attributes of one tag.

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/base/result.h"

namespace trocar::formats {

struct XmlTag {
  enum class Kind : std::uint8_t { Open, Close, Empty };

  Kind kind = Kind::Open;
  std::string_view name;
  std::vector<std::pair<std::string_view, std::string_view>> attributes;

  // The value of an attribute, or `otherwise` where there is none.
  std::string_view value(std::string_view attribute, std::string_view otherwise = {}) const;
};

class XmlTags {
 public:
  XmlTags(std::string_view text, std::string name) : text_(text), name_(std::move(name)) {}

  // False at the end of the file. Error: something that is no tag.
  Result<bool> next(XmlTag& tag);
  // Returns the text between the last tag and the next.
  std::string_view content() const;
  // All that follows the last tag.
  std::string_view rest() const { return text_.substr(position_); }

  // Reads "name:line: what", with the line of the last tag.
  Error error(const std::string& what) const;

 private:
  Result<bool> parse(std::string_view inside, XmlTag& tag) const;

  std::string_view text_;
  std::string name_;
  std::size_t position_ = 0, tag_at_ = 0;
};

}  // namespace trocar::formats
