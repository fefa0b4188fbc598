// Certificates, digests, private files, and text that people will see.

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "common/base/printable.h"
#include "common/secure/certificate.h"
#include "common/secure/digest.h"
#include "common/secure/link_file.h"
#include "common/secure/loopback.h"
#include "common/secure/private_files.h"
#include "common/secure/tls.h"
#include "tests/secure/folder.h"

namespace trocar::secure {
namespace {

TEST(Digest, known_answers) {
  EXPECT_EQ(to_hex(sha256(bytes_of(std::string_view("abc")))),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(to_hex(hmac_sha256(bytes_of(std::string_view("Jefe")),
                               bytes_of(std::string_view("what do ya want for nothing?")))),
            "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843");
  const Bytes bytes{0, 1, 0xfe};
  EXPECT_EQ(from_hex(to_hex(bytes)), bytes);
  EXPECT_TRUE(from_hex("0g").empty());
  EXPECT_TRUE(equal_in_constant_time(bytes, bytes));
  EXPECT_FALSE(equal_in_constant_time(bytes, Bytes{0, 1}));
}

TEST(Certificate, its_code_is_scrypt_of_its_digest) {
  // Python: hashlib.scrypt(sha256(b"der").digest(), salt=b"trocar-certificate-1", n=2**14, r=8,
  // p=1, dklen=5).
  EXPECT_EQ(to_hex(code_of_certificate(bytes_of(std::string_view("der")))), "ec01b8a346");
}

TEST(Certificate, two_of_them_differ_and_both_serve) {
  const auto first = make_identity(), second = make_identity();
  ASSERT_TRUE(first.ok() && second.ok());
  EXPECT_TRUE(make_server_context(*first, "first").ok());
  const auto a = certificate_der(first->certificate_pem, "a");
  const auto b = certificate_der(second->certificate_pem, "b");
  ASSERT_TRUE(a.ok() && b.ok());
  EXPECT_NE(code_of_certificate(*a), code_of_certificate(*b));
  const auto mixed = make_server_context({first->certificate_pem, second->key_pem}, "mixed");
  ASSERT_FALSE(mixed.ok());
  EXPECT_NE(mixed.error().message.find("of one pair"), std::string::npos);
  EXPECT_FALSE(certificate_der("no PEM", "c").ok());
}

TEST(PrivateFiles, folders_are_0700_and_files_0600) {
  const testing::Folder parent;
  const auto folder = parent.path() / "a" / "state";
  ASSERT_TRUE(make_private_folder(folder).ok());
  EXPECT_EQ(testing::mode_of(folder), 0700u);
  ASSERT_TRUE(write_private_file(folder / "secret", "text").ok());
  EXPECT_EQ(testing::mode_of(folder / "secret"), 0600u);
  EXPECT_EQ(*read_private_file(folder / "secret"), "text");
  ::chmod((folder / "secret").c_str(), 0644);
  const auto open = read_private_file(folder / "secret");
  ASSERT_FALSE(open.ok());
  EXPECT_NE(open.error().message.find("chmod 600"), std::string::npos);
  ::chmod(folder.c_str(), 0755);
  EXPECT_FALSE(make_private_folder(folder).ok());
  EXPECT_FALSE(read_private_file(folder / "none").ok());
}

TEST(LinkFile, is_private_and_gives_the_code_of_a_role) {
  const testing::Folder folder;
  ::setenv("XDG_RUNTIME_DIR", folder.path().c_str(), 1);
  ::setenv("XDG_STATE_HOME", folder.path().c_str(), 1);
  const JoinCode code{{1, 2, 3, 4, 5}, {6, 7, 8, 9, 10}};
  EXPECT_FALSE(read_link_file(7690, "surgeon").ok());
  const auto path = write_link_file(7690, {{"surgeon", code}});
  ASSERT_TRUE(path.ok());
  EXPECT_EQ(testing::mode_of(*path), 0600u);
  EXPECT_EQ(*path, folder.path() / "trocar" / "7690.json");
  const auto read = read_link_file(7690, "surgeon");
  ASSERT_TRUE(read.ok());
  EXPECT_EQ(*read, code);
  EXPECT_FALSE(read_link_file(7690, "observer").ok());
  EXPECT_FALSE(read_link_file(7691, "surgeon").ok());
  ASSERT_TRUE(write_private_file(*path, "{\"codes\": 3").ok());
  EXPECT_FALSE(read_link_file(7690, "surgeon").ok());
  ::unsetenv("XDG_RUNTIME_DIR");
}

TEST(Loopback, only_addresses_of_this_machine) {
  for (const char* address : {"127.0.0.1", "127.1.2.3", "::1"})
    EXPECT_TRUE(is_loopback(address)) << address;
  for (const char* address :
       {"", "localhost", "127.example.org", "127.1", "128.0.0.1", "0.0.0.0", "::", "192.168.1.20"})
    EXPECT_FALSE(is_loopback(address)) << address;
}

TEST(Printable, a_name_is_utf8_and_bytes_that_are_none_are_taken_for_latin1) {
  EXPECT_EQ(as_name("Gef\u00e4\u00df", 40), "Gef\u00e4\u00df");
  EXPECT_EQ(as_name("Gef\xe4\xdf", 40), "Gef\u00e4\u00df");
  EXPECT_EQ(as_name("a\x1b[m\u202e\x80\xff", 40), "a_[m__\u00ff");
  EXPECT_EQ(as_name("\u00e4\u00e4\u00e4", 5), "\u00e4\u00e4") << "no half of a letter";
  EXPECT_EQ(as_name("", 5), "");
}

TEST(Printable, what_cannot_be_printed_becomes_a_question_mark) {
  EXPECT_EQ(printable("Ada \xc3\x96zlem"), "Ada \xc3\x96zlem");
  EXPECT_EQ(printable("a\x1b[31mb\n\x7f"), "a?[31mb??");
  EXPECT_EQ(printable("\xe2\x80\xae"
                      "evil\xc2\x9b"),
            "?evil?");
  EXPECT_EQ(printable("\xff\xc3"), "??");
  EXPECT_EQ(printable("abcdef", 3), "abc");
  for (int seed = 0; seed < 200; ++seed) {
    std::string text;
    for (int i = 0; i < 50; ++i) text += static_cast<char>((seed * 131 + i * i * 7) % 256);
    EXPECT_TRUE(is_printable(std::string_view(printable(text))));
  }
}

}  // namespace
}  // namespace trocar::secure
