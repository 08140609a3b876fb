// The linter of the scripts; .ci/run installs it and runs it on static/js.
import js from "@eslint/js";
import globals from "globals";

export default [
  js.configs.recommended,
  {
    languageOptions: { ecmaVersion: 2023, sourceType: "module", globals: globals.browser },
    linterOptions: { reportUnusedDisableDirectives: "error" },
    rules: {
      eqeqeq: "error",
      "no-unused-vars": ["error", { argsIgnorePattern: "^_", varsIgnorePattern: "^_" }],
      "no-shadow": "error",
      "no-var": "error",
      "prefer-const": "error",
      "no-implicit-globals": "error",
      "no-unused-expressions": "error",
      "object-shorthand": "error",
      "default-case-last": "error",
      "no-self-compare": "error",
      "no-template-curly-in-string": "error",
    },
  },
];
