// Starts the page of a recording, whose steps are in it.

if (canUnpack()) {
  readColumns().then(() => main()).catch((error) => {
    trouble(`The steps can't be shown: ${error.message}. The tables below can be read.`);
    throw error;
  });
}
