// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "model_file/model.h"

namespace twin::test
{
namespace
{

// A folder of installed models, for one test.
class Installed : public testing::Test
{
protected:
    void SetUp() override
    {
        std::filesystem::create_directories(folder_ / "kind");
        std::ofstream(folder_ / "kind" / "first_test.toml") << "[robot]\nmass_kg = 3\n";
        std::ofstream(folder_ / "second_test.toml") << "[robot]\nmass_kg = -3\n";
        std::ofstream(folder_ / "scene.xml") << "<mujoco/>";
        setenv("TWINMILL_MODELS", folder_.c_str(), 1);
    }
    void TearDown() override
    {
        unsetenv("TWINMILL_MODELS");
        std::filesystem::remove_all(folder_);
    }
    std::string LoadComplaint(const std::string &name)
    {
        try
        {
            Model::Load(name);
        }
        catch (const std::invalid_argument &error)
        {
            return error.what();
        }
        return "accepted";
    }
    const std::filesystem::path folder_{
        testing::TempDir() + "twinmill_models_" +
        testing::UnitTest::GetInstance()->current_test_info()->name()};
};

TEST_F(Installed, ModelIsFoundByItsName)
{
    EXPECT_EQ(Model::Load("first_test.toml").robot.mass_kg, 3);
}

TEST_F(Installed, ModelIsFoundByItsPath)
{
    EXPECT_EQ(Model::Load((folder_ / "kind" / "first_test.toml").string()).robot.mass_kg, 3);
}

TEST_F(Installed, ModelIsFoundWithoutItsEndingAlsoBesideAFolderOfThatName)
{
    std::filesystem::create_directories(folder_ / "first_test");
    EXPECT_EQ(Model::Load("first_test").robot.mass_kg, 3);
}

TEST_F(Installed, NameLongerThanAnyFilesIsRefused)
{
    EXPECT_NE(LoadComplaint(std::string(5000, 'x')).find("no such file"), std::string::npos);
}

TEST_F(Installed, MissingModelListsThoseThereAre)
{
    const std::string complaint = LoadComplaint("third_test.toml");
    EXPECT_EQ(complaint,
              "third_test.toml: no such file here, nor among the installed models "
              "(first_test.toml, second_test.toml)");
}

TEST_F(Installed, MissingFolderIsNoCrash)
{
    setenv("TWINMILL_MODELS", "/no/such/other/../folder", 1);
    EXPECT_EQ(LoadComplaint("third_test.toml"),
              "third_test.toml: no such file here, nor among the installed models "
              "(none in /no/such/folder)");
}

TEST_F(Installed, ErrorInAFileNamesTheFile)
{
    EXPECT_EQ(LoadComplaint("second_test.toml").rfind((folder_ / "second_test.toml").string(), 0),
              0u);
}

}  // namespace
}  // namespace twin::test
