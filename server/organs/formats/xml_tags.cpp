#include "server/organs/formats/xml_tags.h"

#include <algorithm>

namespace trocar::formats {
namespace {

constexpr const char* kXmlBlanks = " \t\r\n";
constexpr std::size_t kMaxXmlAttributes = 50;

void skip_blanks(std::string_view& text) {
  text = text.substr(std::min(text.find_first_not_of(kXmlBlanks), text.size()));
}

}  // namespace

std::string_view XmlTag::value(std::string_view attribute, std::string_view otherwise) const {
  for (const auto& [key, value] : attributes)
    if (key == attribute) return value;
  return otherwise;
}

Error XmlTags::error(const std::string& what) const {
  const auto line =
      1 + std::count(text_.begin(), text_.begin() + static_cast<std::ptrdiff_t>(tag_at_), '\n');
  return {ErrorCode::BadFile, name_ + ":" + std::to_string(line) + ": " + what};
}

Result<bool> XmlTags::next(XmlTag& tag) {
  while (true) {
    tag_at_ = std::min(text_.find('<', position_), text_.size());
    if (tag_at_ == text_.size()) return false;
    const auto begins = [&](std::string_view what) {
      return text_.substr(tag_at_).starts_with(what);
    };
    const bool is_comment = begins("<!--"), is_declaration = begins("<?");
    const std::string_view end = is_comment ? "-->" : is_declaration ? "?>" : ">";
    const auto end_at = text_.find(end, tag_at_);
    if (end_at == std::string_view::npos)
      return error("a tag is never closed: the file is cut off");
    const auto inside = text_.substr(tag_at_ + 1, end_at - tag_at_ - 1);
    position_ = end_at + end.size();
    if (is_comment || is_declaration) continue;
    return parse(inside, tag);
  }
}

Result<bool> XmlTags::parse(std::string_view inside, XmlTag& tag) const {
  tag = {};
  if (inside.starts_with('/')) {
    tag.kind = XmlTag::Kind::Close;
    inside.remove_prefix(1);
  } else if (inside.ends_with('/')) {
    tag.kind = XmlTag::Kind::Empty;
    inside.remove_suffix(1);
  }
  const auto name_end = std::min(inside.find_first_of(kXmlBlanks), inside.size());
  tag.name = inside.substr(0, name_end);
  inside.remove_prefix(name_end);
  if (tag.name.empty() || tag.name.find_first_of("<!&\"'=") != std::string_view::npos)
    return error("a tag has no name, or is of a kind that is not read");
  for (skip_blanks(inside); !inside.empty(); skip_blanks(inside)) {
    const auto equals = inside.find('=');
    if (equals == std::string_view::npos || tag.attributes.size() == kMaxXmlAttributes)
      return error("attributes must look like name=\"value\"");
    auto key = inside.substr(0, equals);
    key = key.substr(0, key.find_last_not_of(kXmlBlanks) + 1);
    inside.remove_prefix(equals + 1);
    skip_blanks(inside);
    const char mark = inside.empty() ? ' ' : inside.front();
    const auto end = mark == '"' || mark == '\'' ? inside.find(mark, 1) : std::string_view::npos;
    if (end == std::string_view::npos) return error("attributes must look like name=\"value\"");
    tag.attributes.emplace_back(key, inside.substr(1, end - 1));
    inside.remove_prefix(end + 1);
  }
  return true;
}

std::string_view XmlTags::content() const {
  const auto end = std::min(text_.find('<', position_), text_.size());
  return text_.substr(position_, end - position_);
}

}  // namespace trocar::formats
