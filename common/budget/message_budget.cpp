#include "common/budget/message_budget.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/wire_format_lite.h>

namespace trocar {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::internal::WireFormatLite;

constexpr std::uint32_t kMaxNesting = 20;
// Memory of one of them, rounded up: an object, a string's object, an unknown field.
constexpr std::size_t kMessageBytes = 256, kTextBytes = 64, kUnknownBytes = 64;

class Walk {
 public:
  explicit Walk(std::size_t budget) : left_(budget) {}

  // False: malformed or beyond the budget.
  bool message(const google::protobuf::Descriptor& type, BytesView bytes, std::uint32_t depth) {
    if (depth > kMaxNesting || !take(kMessageBytes)) return false;
    google::protobuf::io::CodedInputStream in(bytes.data(), static_cast<int>(bytes.size()));
    while (const auto tag = in.ReadTag()) {
      const auto* field = type.FindFieldByNumber(WireFormatLite::GetTagFieldNumber(tag));
      const auto kind = WireFormatLite::GetTagWireType(tag);
      if (kind != WireFormatLite::WIRETYPE_LENGTH_DELIMITED) {
        if (!take(field ? 8 : kUnknownBytes) || !WireFormatLite::SkipField(&in, tag)) return false;
        continue;
      }
      std::uint32_t length = 0;
      if (!in.ReadVarint32(&length)) return false;
      const auto at = static_cast<std::size_t>(in.CurrentPosition());
      if (length > bytes.size() - at || !in.Skip(static_cast<int>(length))) return false;
      if (!content(field, bytes.subspan(at, length), depth)) return false;
    }
    return in.ConsumedEntireMessage();
  }

  bool is_spent() const { return is_spent_; }

 private:
  bool content(const FieldDescriptor* field, BytesView bytes, std::uint32_t depth) {
    if (!field) return take(kUnknownBytes + bytes.size());
    switch (field->cpp_type()) {
      case FieldDescriptor::CPPTYPE_MESSAGE:
        return message(*field->message_type(), bytes, depth + 1);
      case FieldDescriptor::CPPTYPE_STRING:
        return take(kTextBytes + bytes.size());
      case FieldDescriptor::CPPTYPE_DOUBLE:
      case FieldDescriptor::CPPTYPE_FLOAT:
        return take(bytes.size());
      default: {
        std::size_t numbers = 0;  // each ends with a byte below 128
        for (const auto byte : bytes) numbers += byte < 128;
        const bool is_wide = field->cpp_type() == FieldDescriptor::CPPTYPE_INT64 ||
                             field->cpp_type() == FieldDescriptor::CPPTYPE_UINT64;
        return take(numbers * (is_wide ? 8 : 4));
      }
    }
  }

  bool take(std::size_t bytes) {
    is_spent_ = bytes > left_;
    left_ -= is_spent_ ? 0 : bytes;
    return !is_spent_;
  }

  std::size_t left_;
  bool is_spent_ = false;
};

}  // namespace

Status check_budget(const google::protobuf::Descriptor& type, BytesView message,
                    std::size_t budget_bytes) {
  Walk walk(budget_bytes);
  if (walk.message(type, message, 0)) return {};
  if (!walk.is_spent()) return Error{ErrorCode::BadFile, "is not a sound message"};
  return Error{ErrorCode::BadFile,
               "would take more than " + std::to_string(budget_bytes >> 20) +
                   " MiB, 16 times its size and 16 MiB: it is damaged or made to harm"};
}

}  // namespace trocar
