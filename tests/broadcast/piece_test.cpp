// Pieces are as documented, and whatever else comes is refused.

#include "server/watch/bus/piece.h"

#include <gtest/gtest.h>

#include "server/watch/bus/subjects.h"

namespace trocar::bus {
namespace {

Bytes some_bytes(std::size_t size) {
  Bytes bytes(size);
  for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<std::uint8_t>(i * 7 + i / 256);
  return bytes;
}

TEST(Pieces, are_these_bytes) {
  const Bytes content{0xaa, 0xbb};
  const auto bytes =
      write_piece({.publisher = 0x0102, .number = 3, .piece = 1, .pieces = 2, .bytes = content});
  EXPECT_EQ(bytes, (Bytes{'T', 'R', 'C', '1', 2, 1, 0, 0, 0, 0, 0, 0, 3, 0,    0,
                          0,   0,   0,   0,   0, 1, 0, 0, 0, 2, 0, 0, 0, 0xaa, 0xbb}));
  const auto read = read_piece(bytes);
  ASSERT_TRUE(read.ok());
  EXPECT_EQ(read->publisher, 0x0102u);
  EXPECT_EQ(read->number, 3u);
  EXPECT_EQ(read->piece, 1u);
  EXPECT_EQ(read->pieces, 2u);
  EXPECT_EQ(Bytes(read->bytes.begin(), read->bytes.end()), content);
}

TEST(Pieces, that_cannot_be_are_refused) {
  const Bytes content{1, 2, 3};
  const auto bytes = write_piece({.number = 1, .piece = 0, .pieces = 1, .bytes = content});
  for (std::size_t size = 0; size <= kPieceHeaderBytes; ++size)
    EXPECT_FALSE(read_piece(BytesView(bytes).first(size)).ok()) << size;
  EXPECT_TRUE(read_piece(BytesView(bytes).first(kPieceHeaderBytes + 1)).ok());
  auto other = bytes;
  other[3] = '2';
  EXPECT_FALSE(read_piece(other).ok());
  EXPECT_FALSE(read_piece(write_piece({.piece = 2, .pieces = 2, .bytes = content})).ok());
  EXPECT_TRUE(read_piece(write_piece({.piece = 1, .pieces = 2, .bytes = content})).ok());
  EXPECT_FALSE(read_piece(write_piece({.pieces = 0, .bytes = content})).ok());
  EXPECT_FALSE(read_piece(write_piece({.piece = 1, .pieces = 0, .bytes = {}})).ok());
  EXPECT_TRUE(read_piece(write_piece({.number = 9, .bytes = {}})).ok()) << "a sign of life";
}

TEST(Pieces, make_the_whole_again_whatever_their_size) {
  for (const std::size_t size : {1u, 99u, 100u, 101u, 1000u, 70'001u}) {
    const auto whole = some_bytes(size);
    const auto pieces = cut(5, 6, whole, kPieceHeaderBytes + 100);
    EXPECT_EQ(pieces.size(), (size + 99) / 100);
    Assembler assembler;
    for (std::size_t i = 0; i < pieces.size(); ++i) {
      EXPECT_LE(pieces[i].size(), kPieceHeaderBytes + 100);
      const auto added = assembler.add(*read_piece(pieces[i]));
      ASSERT_TRUE(added.ok());
      ASSERT_EQ(added->has_value(), i + 1 == pieces.size());
      if (added->has_value()) {
        EXPECT_EQ(**added, whole);
      }
    }
  }
}

TEST(Pieces, do_not_follow_those_of_another_message_or_with_one_missing) {
  const auto whole = some_bytes(300);
  const auto pieces = cut(5, 6, whole, kPieceHeaderBytes + 100);
  for (const auto& wrong :
       {cut(4, 6, whole, kPieceHeaderBytes + 100), cut(5, 7, whole, kPieceHeaderBytes + 100),
        cut(5, 6, whole, kPieceHeaderBytes + 60)}) {
    Assembler assembler;
    ASSERT_TRUE(assembler.add(*read_piece(pieces[0])).ok());
    EXPECT_FALSE(assembler.add(*read_piece(wrong[1])).ok());
  }
  Assembler assembler;
  EXPECT_FALSE(assembler.add(*read_piece(pieces[1])).ok());
  ASSERT_TRUE(assembler.add(*read_piece(pieces[0])).ok());
  EXPECT_FALSE(assembler.add(*read_piece(pieces[2])).ok());
  EXPECT_FALSE(assembler.add(*read_piece(pieces[1])).ok()) << "what went wrong begins anew";
  for (const auto& piece : pieces) ASSERT_TRUE(assembler.add(*read_piece(piece)).ok());
}

TEST(Pieces, are_no_more_together_than_allowed) {
  const Bytes much(8 * 1024 * 1024);
  Assembler assembler;
  std::uint32_t count = 0;
  while (assembler.add({.piece = count, .pieces = 1000, .bytes = much}).ok()) ++count;
  EXPECT_EQ(count, kMostWholeBytes / much.size());
}

TEST(Messages, are_found_in_a_whole_and_cut_off_ones_are_not) {
  const Bytes first{1, 0, 0, 0, 42}, second{2, 0, 0, 0, 43, 44};
  Bytes whole = first;
  whole.insert(whole.end(), second.begin(), second.end());
  const auto all = split_messages(whole);
  ASSERT_TRUE(all.ok());
  ASSERT_EQ(all->size(), 2u);
  EXPECT_EQ(Bytes((*all)[1].begin(), (*all)[1].end()), second);
  for (std::size_t size = 1; size < whole.size(); ++size)
    EXPECT_EQ(split_messages(BytesView(whole).first(size)).ok(), size == first.size()) << size;
  EXPECT_FALSE(split_messages(Bytes{0, 0, 0, 0}).ok());
  EXPECT_FALSE(split_messages(Bytes{0xff, 0xff, 0xff, 0xff, 1}).ok());
}

TEST(Names, of_sessions_are_parts_of_subjects) {
  EXPECT_TRUE(is_session_name("monday_2-A"));
  EXPECT_TRUE(is_session_name(std::string(64, 'a')));
  for (const auto& name :
       {std::string(), std::string(65, 'a'), std::string("a.b"), std::string("a b"),
        std::string("*"), std::string(">"), std::string("\xc3\xa4")})
    EXPECT_FALSE(is_session_name(name)) << name;
}

TEST(Names, answers_go_to_subjects_for_answers_alone) {
  const Subjects subjects("monday");
  EXPECT_TRUE(subjects.is_for_answers(subjects.answers_to("0af9")));
  for (const auto& other :
       {subjects.stream, subjects.ask, subjects.answers, subjects.answers_to("*"),
        subjects.answers_to(">"), subjects.answers_to("0a.b"),
        subjects.answers_to(std::string(33, 'a')), Subjects("tuesday").answers_to("0af9"),
        std::string("trocar.hall.a.request"), std::string()})
    EXPECT_FALSE(subjects.is_for_answers(other)) << other;
}

}  // namespace
}  // namespace trocar::bus
